#!/usr/bin/env bash
# Builds the library, whose header has to be that of its source, and runs the C program that calls it. That the program links
# says that no panic can be reached: the panic handler calls a function that does not exist. So does the library's
# own link for a Cortex-M.
set -euo pipefail
cd "$(dirname "$0")"
cargo build --quiet --locked --release
${CC:-gcc} -std=c11 -O2 -Wall -Wextra -Werror -Wl,--gc-sections main.c target/release/libcasados_pendulum.a -lm -o target/main
target/main

firmware=thumbv7em-none-eabihf
rustup target add "$firmware" >/dev/null 2>&1 || true
cargo build --quiet --locked --release --target "$firmware"
linker=$(echo "$(rustc --print sysroot)"/lib/rustlib/*/bin/rust-lld)
"$linker" -flavor gnu --gc-sections --entry casados_step --undefined casados_new \
    "target/$firmware/release/libcasados_pendulum.a" -o target/library
