#!/usr/bin/env python3
"""Builds the programs of this crate for a Cortex-M, runs them in QEMU, and holds them to `budgets.toml`.

    run.py            what CI runs: links (no panic is reachable), states as on the desk, budgets
    run.py --tables   the tables of docs/embedded.md

Needs `rustup target add thumbv7em-none-eabihf`. QEMU is the installed one, or Debian's package, unpacked for this
script alone into ~/.cache/casados-firmware.
"""

import os, pathlib, shutil, struct, subprocess, sys, tomllib

HERE = pathlib.Path(__file__).resolve().parent
CACHE = pathlib.Path(os.environ.get("XDG_CACHE_HOME", pathlib.Path.home() / ".cache")) / "casados-firmware"
TARGET = "thumbv7em-none-eabihf"
# Processor: the board that has it. The Cortex-M7 has an FPU for double precision, the M4 one for single precision.
BOARDS = {"cortex-m7": "mps2-an500", "cortex-m4": "mps2-an386"}


def cargo(arguments, **variables):
    subprocess.run(["cargo", *arguments], cwd=HERE, env=os.environ | variables, check=True)


def build(cpu, programs, **variables):
    """The programs, by name. A panic that can be reached is an undefined symbol."""
    bins = [argument for program in programs for argument in ("--bin", program)]
    directory = HERE / "target" / cpu
    flags = {f"CARGO_TARGET_{TARGET.upper().replace('-', '_')}_RUSTFLAGS": f"-C target-cpu={cpu}"}
    cargo(["build", "--quiet", "--release", "--target", TARGET, "--target-dir", str(directory), *bins], **flags, **variables)
    return {program: directory / TARGET / "release" / program for program in programs}


def emulator():
    """The command that starts QEMU."""
    name = "qemu-system-arm"
    if shutil.which(name):
        return [name]
    root = CACHE / "root"
    if not (root / "usr/bin" / name).exists():
        packages = CACHE / "packages"
        (packages / "partial").mkdir(parents=True, exist_ok=True)
        get = ["apt-get", "-qq", "-y", "--download-only", "--no-install-recommends", "-o", "Debug::NoLocking=1"]
        get += ["-o", f"Dir::Cache::archives={packages}", "install", name]
        if subprocess.run(get, capture_output=True).returncode:
            subprocess.run(["apt-get", "-qq", "update"], check=True)
            subprocess.run(get, check=True)
        # Elsewhere first: what was interrupted is not taken for whole.
        part = CACHE / "part"
        shutil.rmtree(part, ignore_errors=True)
        for package in packages.glob("*.deb"):
            subprocess.run(["dpkg", "--extract", package, part], check=True)
        shutil.rmtree(root, ignore_errors=True)
        part.rename(root)
        shutil.rmtree(packages)
    libraries = ":".join(str(path) for path in [*root.glob("usr/lib/*-linux-gnu"), *root.glob("lib/*-linux-gnu")])
    return ["env", f"LD_LIBRARY_PATH={libraries}", str(root / "usr/bin" / name), "-L", str(root / "usr/share/qemu")]


def run(cpu, program):
    """The lines that a program prints: lists of its numbers by name. An instruction takes 128 ns of virtual time."""
    command = [*emulator(), "-M", BOARDS[cpu], "-nographic", "-monitor", "none", "-serial", "null"]
    command += ["-icount", "shift=7,sleep=off", "-semihosting-config", "enable=on,target=native", "-kernel", str(program)]
    return lines(subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60, check=True).stdout)


def desk(program, **variables):
    """The same program on this machine, with the standard library's functions and its widest registers."""
    directory = str(HERE / "target")
    arguments = ["run", "--quiet", "--release", "--target-dir", directory, "--features", "desk", "--bin", program]
    output = subprocess.run(["cargo", *arguments], cwd=HERE, env=os.environ | variables, stdout=subprocess.PIPE, text=True, check=True)
    return lines(output.stdout)


def lines(text):
    values = {}
    for line in text.splitlines():
        name, *words = line.split()
        numbers = [struct.unpack(">d", bytes.fromhex(w[2:]))[0] if w.startswith("0x") else int(w) for w in words]
        values.setdefault(name, []).extend(numbers)
    return values


def sections(program):
    """Bytes of flash and of RAM: what an ELF file says about its segments."""
    data = program.read_bytes()
    start, size, count = (struct.unpack_from(f, data, at)[0] for f, at in (("<I", 28), ("<H", 42), ("<H", 44)))
    flash = ram = 0
    for index in range(count):
        kind, _, address, load, in_file, in_memory = struct.unpack_from("<6I", data, start + index * size)
        if kind == 1:
            flash += in_file
            ram += in_memory if address >= 0x20000000 else 0
    return flash, ram


def distance(a, b):
    """The largest difference of states relative to their size."""
    return max(abs(x - y) / max(abs(x), abs(y), 1.0) for x, y in zip(a, b, strict=True))


def check():
    budgets = tomllib.loads((HERE / "budgets.toml").read_text())
    mistakes = []

    def hold(name, what, value, most):
        print(f"{name:24} {what:30} {value:>10}  of {most}")
        if not value <= most:
            mistakes.append(f"{name}: {what} is {value}, and may be {most}")

    for cpu in BOARDS:
        cases = {name: case for name, case in budgets.items() if case["cpu"] == cpu}
        programs = build(cpu, cases)
        for name, case in cases.items():
            results = run(cpu, programs[name])
            flash, ram = sections(programs[name])
            hold(name, "flash, bytes", flash, case["flash"])
            hold(name, "RAM without stack, bytes", ram, case["ram"])
            for what, most in case.get("most", {}).items():
                hold(name, what, max(results[what]), most)
            for what in case.get("constant", []):
                least, largest = results[what]
                hold(name, f"variation of {what}, %", round(100 * (largest / least - 1), 2), 2)
            if "apart" in case:
                apart = distance(results["state"], desk(name)["state"])
                hold(name, "distance from the desk", float(f"{apart:.1e}"), case["apart"])
    sys.exit("\n".join(mistakes) if mistakes else 0)


MODELS = {"pendulum::Pendulum": "pendulum, 4 states", "quadrotor::PlanarQuadrotor": "6 states", "quadrotor::Quadrotor": "12 states"}


def tables():
    states = {}
    for cpu, number in (("cortex-m7", "f64"), ("cortex-m4", "f32")):
        print(f"\n`{number}` on a {cpu.title()}:\n")
        columns = ["model", "s", "flash", "RAM", "stack", "`solve`", "`forward`", "variation"]
        columns += ["error of `f32`"] if number == "f32" else []
        print("|" + "|".join(f" {column} " for column in columns) + "|\n" + "|---" * len(columns) + "|", flush=True)
        for model, name in MODELS.items():
            for stages in range(1, 5):
                program = build(cpu, ["measure"], CASE=f"{model} {stages} {number}")["measure"]
                results, (flash, ram) = run(cpu, program), sections(program)
                (least, solve), (fewest, forward) = results["solve"], results["forward"]
                variation = 100 * max(solve / least - 1, forward / fewest - 1)
                row = [name, stages, flash, ram, results["stack"][0], solve, forward, f"{variation:.1f} %"]
                exact = states.setdefault((model, stages), results["state"])
                row += [f"{distance(results['state'], exact):.0e}"] if number == "f32" else []
                print("|" + "|".join(f" {cell} " for cell in row) + "|", flush=True)


if __name__ == "__main__":
    tables() if "--tables" in sys.argv else check()
