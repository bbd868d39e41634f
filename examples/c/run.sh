#!/usr/bin/env bash
# Builds the library, whose header has to be that of its source, and runs the C program that calls it.
set -euo pipefail
cd "$(dirname "$0")"
cargo build --quiet --release
${CC:-gcc} -std=c11 -O2 -Wall -Wextra -Werror -Wl,--gc-sections main.c target/release/libcasados_pendulum.a -lm -o target/main
target/main
