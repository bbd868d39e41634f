#!/usr/bin/env python3
"""Builds the programs of this crate for a Cortex-M, runs them in QEMU, and holds them to `budgets.toml`.

    run.py            what CI runs: links (no panic is reachable), states as on the desk, budgets, no double precision in `f32`
    run.py --tables   the tables of docs/embedded.md

Needs `rustup target add thumbv7em-none-eabihf`. QEMU is the installed one, or Debian's package, unpacked for this
script alone into ~/.cache/casados-firmware.
"""

import os, pathlib, re, shutil, struct, subprocess, sys, tempfile, tomllib

HERE = pathlib.Path(__file__).resolve().parent
TARGETS = HERE / "target"
CACHE = pathlib.Path(os.environ.get("XDG_CACHE_HOME", pathlib.Path.home() / ".cache")) / "casados-firmware"
TARGET = "thumbv7em-none-eabihf"
# Processor: the board that has it. The Cortex-M7 has an FPU for double precision, the M4 one for single precision.
BOARDS = {"cortex-m7": "mps2-an500", "cortex-m4": "mps2-an386"}


def cargo(arguments, stderr=None, **variables):
    subprocess.run(["cargo", *arguments], cwd=HERE, env=os.environ | variables, stderr=stderr, check=True)


def build(cpu, programs, **variables):
    """The programs, by name. A panic that can be reached is an undefined symbol."""
    flags = {f"CARGO_TARGET_{TARGET.upper().replace('-', '_')}_RUSTFLAGS": f"-C target-cpu={cpu}"}
    return build_for(TARGET, cpu, programs, ["--release"], **flags, **variables)


def build_for(target, name, programs, arguments, **variables):
    """With a target that is named, the desk's too: then macros and what they need are built once for all of them."""
    bins = [argument for program in programs for argument in ("--bin", program)]
    cargo(["build", "--quiet", "--locked", "--target", target, "--target-dir", str(TARGETS), *arguments, *bins], **variables)
    copies = TARGETS / name
    copies.mkdir(exist_ok=True)
    profile = "release" if "--release" in arguments else "debug"
    return {program: pathlib.Path(shutil.copy(TARGETS / target / profile / program, copies)) for program in programs}


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


def emulate(cpu, program, *arguments):
    """What a program prints, which has to end well. An instruction takes 128 ns of virtual time."""
    command = [*emulator(), "-M", BOARDS[cpu], "-nographic", "-monitor", "none", "-serial", "null"]
    command += ["-icount", "shift=7,sleep=off", "-semihosting-config", "enable=on,target=native", "-kernel", str(program), *arguments]
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60, check=True).stdout


def run(cpu, program, *arguments):
    """The same as lists of numbers by name."""
    return lines(emulate(cpu, program, *arguments))


def to_copy():
    """The package that a user copies: its filter ends with success if the state is where it says."""
    folder = HERE.parent / "microcontroller"
    build = ["cargo", "build", "--quiet", "--locked", "--release", "--target-dir", str(TARGETS)]
    subprocess.run(build, cwd=folder, check=True)
    print(emulate("cortex-m7", TARGETS / TARGET / "release/filter"), end="")


def desk(programs):
    """What the same programs print on this machine, with the standard library's functions."""
    version = subprocess.run(["rustc", "-vV"], stdout=subprocess.PIPE, text=True, check=True).stdout
    host = next(line.split()[1] for line in version.splitlines() if line.startswith("host:"))
    # Its numbers are compared, nothing else: they need no optimiser.
    programs = build_for(host, "desk", programs, ["--features", "desk"], CARGO_PROFILE_DEV_DEBUG="false")
    return {
        name: lines(subprocess.run([program], stdout=subprocess.PIPE, text=True, check=True).stdout)
        for name, program in programs.items()
    }


def lines(text):
    values = {}
    for line in text.splitlines():
        name, *words = line.split()
        numbers = [struct.unpack(">d", bytes.fromhex(w[2:].zfill(16)))[0] if w.startswith("0x") else int(w) for w in words]
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


def functions(program):
    """Address and size of every function, by name: the symbol table of an ELF file."""
    data = program.read_bytes()
    (start,), (size, count) = struct.unpack_from("<I", data, 32), struct.unpack_from("<HH", data, 46)
    headers = [struct.unpack_from("<10I", data, start + index * size) for index in range(count)]
    table = next(header for header in headers if header[1] == 2)
    names = headers[table[6]][4]
    symbols = struct.iter_unpack("<IIIBBH", data[table[4] : table[4] + table[5]])
    name = lambda at: data[names + at : data.index(0, names + at)].decode()
    return {name(at): (value & ~1, size) for at, value, size, info, _, _ in symbols if info & 15 == 2}


# Arithmetic and comparisons of double precision where there is no FPU for it; conversions are not among them.
DOUBLE = re.compile(r"__aeabi_(c?d(add|sub|rsub|mul|div|neg|cmp\w+)|u?i2d|u?l2d|d2u?iz|d2u?lz)|fmax|fmin")


def doubles(cpu, program):
    """Calls of functions of double precision while instructions are counted."""
    places = functions(program)
    begin = next(at for name, at in places.items() if "5ticks" in name)[0]
    entries = {at: name for name, (at, _) in places.items() if DOUBLE.fullmatch(name)}
    with tempfile.NamedTemporaryFile() as log:
        ranges = ",".join(f"{at:#x}+2" for at in [begin, *entries])
        run(cpu, program, "-d", "exec,nochain", "-dfilter", ranges, "-D", log.name)
        counting, found = False, {}
        for line in map(bytes.decode, log):
            at = int(line.split("[")[1].split("/")[1], 16)
            if at == begin:
                counting = not counting
            elif counting and at in entries:
                found[entries[at]] = found.get(entries[at], 0) + 1
    return found


def distance(a, b):
    """The largest difference of states relative to their size."""
    return max(abs(x - y) / max(abs(x), abs(y), 1.0) for x, y in zip(a, b, strict=True))


def links(cpu, program):
    """Whether a program links; that another than the linker is against it is an error."""
    try:
        build(cpu, [program], stderr=subprocess.PIPE)
    except subprocess.CalledProcessError as error:
        if b"undefined symbol: a_panic_is_reachable" not in error.stderr:
            sys.exit(error.stderr.decode())
        return False
    return True


DOCUMENTED = {
    "Pendulum-f64": "pendulum, 4 states",
    "PlanarQuadrotor-f64": "6 states",
    "Quadrotor-f64": "12 states",
    "implicit": "`Irk`, `Gauss<2>`",
    "explicit": "`Erk`, `Rk4`",
}


def documented():
    """Rows of the sizes of integrators that no documentation has."""
    files = (HERE.parents[1] / file for file in ("docs/embedded.md", "casados-core/src/memory.rs"))
    text = "".join(file.read_text() for file in files)
    sizes = run("cortex-m7", build("cortex-m7", ["sizes"])["sizes"])
    for name, model in DOCUMENTED.items():
        values = sizes[name]
        if name.endswith("f64"):
            values = [f"{whole}, {lean}" for whole, lean in zip(values[::2], values[1::2])]
        row = "|" + "|".join(f" {cell} " for cell in [model, *values]) + "|"
        if row not in text:
            yield f"documentation: sizes are {row}"


def check():
    to_copy()
    budgets = tomllib.loads((HERE / "budgets.toml").read_text())
    mistakes = []

    def hold(name, what, value, most):
        print(f"{name:24} {what:30} {value:>10}  of {most}")
        if not value <= most:
            mistakes.append(f"{name}: {what} is {value}, and may be {most}")

    on_desk = desk({case.get("program", name) for name, case in budgets.items() if "apart" in case})
    for cpu in BOARDS:
        cases = {name: case for name, case in budgets.items() if case["cpu"] == cpu}
        programs = build(cpu, {case.get("program", name) for name, case in cases.items()})
        for name, case in cases.items():
            program = case.get("program", name)
            results = run(cpu, programs[program])
            flash, ram = sections(programs[program])
            hold(name, "flash, bytes", flash, case["flash"])
            hold(name, "RAM without stack, bytes", ram, case["ram"])
            for what, most in case.get("most", {}).items():
                hold(name, what, max(results[what]), most)
            for what, most in case.get("steady", {}).items():
                least, largest = results[what]
                hold(name, what, largest, most)
                hold(name, f"variation of {what}, %", round(100 * (largest / least - 1), 2), 0.5)
            if "apart" in case:
                apart = distance(results["state"], on_desk[program]["state"])
                hold(name, "distance from the desk", float(f"{apart:.1e}"), case["apart"])
            if "doubles" in case:
                found = doubles(cpu, programs[program])
                hold(name, "calls of double precision", sum(found.values()), case["doubles"])
    mistakes += documented()
    if links("cortex-m7", "panics"):
        mistakes.append("panics: a program that can panic links")
    sys.exit("\n".join(mistakes) if mistakes else 0)


MODELS = {"pendulum::Pendulum": "pendulum, 4 states", "quadrotor::PlanarQuadrotor": "6 states", "quadrotor::Quadrotor": "12 states"}


def tables():
    states = {}
    for cpu, number in (("cortex-m7", "f64"), ("cortex-m4", "f32")):
        sizes = run(cpu, build(cpu, ["sizes"])["sizes"])
        print(f"\n`{number}` on a {cpu.title()}:\n")
        columns = ["model", "s", "flash", "integrator", "with fallback", "stack", "`solve`", "`forward`", "variation", "with fallback, at most"]
        columns += ["error of `f32`"] if number == "f32" else []
        print("|" + "|".join(f" {column} " for column in columns) + "|\n" + "|---" * len(columns) + "|", flush=True)
        for model, name in MODELS.items():
            for stages in range(1, 5):
                # The worst case is that of an integrator which pivots the whole matrix.
                results, flash = {}, 0
                for program, fallback in (("measure_pivoted", "Pivoting"), ("measure", "Refusing")):
                    file = build(cpu, [program], CASE=f"{model} {stages} {number} {fallback}")[program]
                    results[program], (flash, _) = run(cpu, file), sections(file)
                worst, usual = results["measure_pivoted"], results["measure"]
                (least, solve), (fewest, forward) = usual["solve"], usual["forward"]
                variation = 100 * max(solve / least - 1, forward / fewest - 1)
                whole, lean = sizes[f"{model.split('::')[1]}-{number}"][2 * stages - 2 : 2 * stages]
                row = [name, stages, flash, lean, whole, usual["stack"][0], solve, forward, f"{variation:.2f} %", worst["forward"][1]]
                exact = states.setdefault((model, stages), usual["state"])
                row += [f"{distance(usual['state'], exact):.0e}"] if number == "f32" else []
                print("|" + "|".join(f" {cell} " for cell in row) + "|", flush=True)


MODES = {
    "pendulum": "pendulum, Gauss, 2 stages",
    "pendulum-erk": "pendulum, `Rk4`",
    "catalyst": "DAE, 3 states and an algebraic one, Radau IIA, 2 stages",
    "six": "6 states, Gauss, 2 stages",
    "twelve": "12 states, Gauss, 1 stage",
    "twelve-erk": "12 states, `Rk4`",
}


def modes():
    """What every kind of call takes, in `f64` and `f32`: the most instructions, and how much more that is than the least."""
    results = []
    for cpu, number in (("cortex-m7", "f64"), ("cortex-m7", "f32"), ("cortex-m4", "f32")):
        program = f"modes_{number}"
        results.append(run(cpu, build(cpu, [program])[program]))
    calls = ["solve", "forward", "adjoint", "hessian"]
    print("\nEvery kind of call, `f64` on a Cortex-M7, `f32` on a Cortex-M7 and on a Cortex-M4:\n")
    columns = ["model, method", *(f"`{call}`" for call in calls), "variation"]
    print("|" + "|".join(f" {column} " for column in columns) + "|\n" + "|---" * len(columns) + "|")
    for name, model in MODES.items():
        ranges = [[result[f"{name}-{call}"] for result in results] for call in calls]
        variation = max(most / least - 1 for call in ranges for least, most in call)
        cells = [", ".join(str(most) for _, most in call) for call in ranges]
        print("|" + "|".join(f" {cell} " for cell in [model, *cells, f"{100 * variation:.2f} %"]) + "|")


if __name__ == "__main__":
    if "--tables" in sys.argv:
        tables()
        modes()
    else:
        check()
