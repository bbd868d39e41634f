"""docs/paper.md and its pictures, out of what was measured."""

import platform
import textwrap

import casadi as ca
import matplotlib
from common import ROOT

matplotlib.use("svg")
import matplotlib.pyplot as plt

PICTURES = ROOT / "docs" / "paper"
WHOLE, HORIZON, INTERVALS = "casados, whole problem", "casados, horizon", "casados, intervals"
CALLBACKS = "acados, call-backs"
THEIRS, DIRECT, INTERIOR = "CasADi collocation", "direct collocation", "casados interior point"
SETTINGS = {"s2n1": "two stages, one step", "s4n4": "four stages, four steps"}


def milliseconds(seconds):
    """Three digits."""
    value = 1e3 * seconds
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def table(head, rows):
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def per_iteration(run, key):
    return run[key] / max(run["iterations"], 1)


def ran(runs):
    """Those that did not raise."""
    return {name: run for name, run in runs.items() if "error" not in run}


def failures(runs):
    """A line for each that raised, under the table: `runs` has those of each column."""
    said = {}
    for column, rows in runs.items():
        for name, run in rows.items():
            if "error" in run:
                said.setdefault((name, run["error"]), []).append(str(column))
    where = lambda columns: f" ({', '.join(columns)})" if any(columns) else ""
    return "\n".join(f"- {name}{where(columns)} raised `{error}`" for (name, error), columns in said.items())


def draw(chains, setting):
    """Milliseconds of an iteration over masses, of all that took part."""
    masses = sorted(int(key.split()[0]) for key in chains if key.endswith(setting))
    plt.rcParams.update({"svg.hashsalt": setting, "svg.fonttype": "none", "font.size": 8})
    figure, both = plt.subplots(1, 2, figsize=(9, 4.2), sharey=True)
    names = list(dict.fromkeys(name for m in masses for name in chains[f"{m} {setting}"]))
    for axes, key, title in zip(both, ["total", "functions"], ["an iteration", "its functions"]):
        for index, name in enumerate(names):
            points = [(m, chains[f"{m} {setting}"].get(name)) for m in masses]
            points = [(m, 1e3 * per_iteration(run, key)) for m, run in points if run and "error" not in run]
            if not points:
                continue
            style = {"casados": "-", "direct": ":", "acados": "-."}.get(name.split()[0].strip(","), "--")
            axes.plot(*zip(*points), style, marker="osv^D<>px*"[index % 10], markersize=4, label=name)
        axes.set(yscale="log", xlabel="masses", xticks=masses, title=f"milliseconds of {title}")
        axes.grid(True, which="major", linewidth=0.3)
    both[1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    figure.tight_layout()
    PICTURES.mkdir(parents=True, exist_ok=True)
    figure.savefig(PICTURES / f"chain_{setting}.svg", metadata={"Date": None})
    plt.close(figure)


def cell(run):
    """Milliseconds of an iteration, of its functions, and iterations."""
    if run is None:
        return ""
    if "error" in run:
        return "raised"
    mark = "" if run["complete"] else "*"
    total, functions = (milliseconds(per_iteration(run, key)) for key in ["total", "functions"])
    return f"{total} ({functions}) · {run['iterations']}{mark}"


def chain(chains, setting):
    masses = sorted(int(key.split()[0]) for key in chains if key.endswith(setting))
    runs = {m: chains[f"{m} {setting}"] for m in masses}
    names = list(dict.fromkeys(name for run in runs.values() for name in run))

    rows = [[name] + [cell(runs[m].get(name)) for m in masses] for name in names]
    head = ["ms of an iteration (of its functions) · iterations", *[f"{m} masses" for m in masses]]
    said = failures({f"{m} masses": run for m, run in runs.items()})
    return "\n\n".join(filter(None, [table(head, rows), said]))


def peers(results):
    """acados beside CasADi's integrator, all sizes and both settings in one table."""
    runs = results["peers"]["runs"]
    names = list(dict.fromkeys(name for run in runs.values() for name in run))
    key = lambda key: (key.split()[1], int(key.split()[0]))
    rows = []
    for stamp in sorted(runs, key=key):
        masses, setting = stamp.split()
        row = runs[stamp]
        both = [row[name] for name in [THEIRS, CALLBACKS] if name in row and "error" not in row[name]]
        ratio = f"{both[0]['functions'] / both[1]['functions']:.3g}" if len(both) == 2 else ""
        apart = f"{abs(both[0]['objective'] / both[1]['objective'] - 1.0):.1e}" if len(both) == 2 else ""
        rows.append([f"{masses} masses, {setting}", *[cell(row.get(name)) for name in names], ratio, apart])
    head = ["", *names, "functions: CasADi's / acados'", "objectives apart"]
    said = failures({stamp: run for stamp, run in runs.items()})
    words = PEERS.format(**{key: results["peers"][key] for key in ["machine", "date", "load", "version"]})
    first, last = words.strip().rsplit("\n\n", 1)
    return "\n\n".join(filter(None, [first, textwrap.fill(last, 100), table(head, rows), said]))


def agreement(chains, setting):
    """The largest relative difference of objectives of the same discrete problem."""
    worst = 0.0
    for key, runs in chains.items():
        runs = ran(runs)
        if key.endswith(setting) and WHOLE in runs:
            same = [runs[name]["objective"] for name in [WHOLE, HORIZON, INTERVALS, THEIRS] if name in runs]
            worst = max(worst, (max(same) - min(same)) / abs(max(same)))
    return worst


def goals(chains, orbit, intervals):
    """What was to be reached, and what was."""
    rows = []
    for key in sorted(chains, key=lambda key: (key.split()[1], key)):
        runs, (masses, setting) = ran(chains[key]), key.split()
        if not {THEIRS, INTERVALS, WHOLE, INTERIOR} <= runs.keys():
            continue
        ratio = lambda one, other, part: f"{runs[one][part] / runs[other][part]:.3g}"
        rows.append(
            [
                f"{masses} masses, {setting}",
                ratio(THEIRS, INTERVALS, "functions"),
                ratio(THEIRS, WHOLE, "functions"),
                ratio(THEIRS, INTERVALS, "total"),
                ratio(THEIRS, WHOLE, "total"),
                ratio(DIRECT, INTERVALS, "total") if DIRECT in runs else "",
                ratio(DIRECT, WHOLE, "total") if DIRECT in runs else "",
                f"{per_iteration(runs[WHOLE], 'functions') / per_iteration(runs[INTERIOR], 'functions'):.3g}",
            ]
        )
    head = ["", "functions: CasADi's / intervals", "/ whole problem", "total: CasADi's / intervals", "/ whole problem"]
    head += ["total: direct / intervals", "/ whole problem", "functions of an iteration: whole / own interior point"]
    return table(head, rows)


def orbits(runs):
    rows = []
    for name, run in runs.items():
        if "error" in run:
            rows.append([name, "raised", "", "", "", ""])
            continue
        step = run["total"] - run["functions"]
        times = [milliseconds(value) for value in [run["total"], run["functions"], step]]
        rows.append([name, *times, run["iterations"], f"{run['objective']:.9f}"])
    head = ["", "total, ms", "functions", "step computation", "iterations", "objective"]
    return "\n\n".join(filter(None, [table(head, rows), failures({"": runs})]))


# Table of the paper: casados through a call-back, CasADi 3.5.5, on a laptop of 2022; milliseconds.
PAPER = {"simulation": [0.2554, 7.08], "Jacobian": [0.6839, 790.0]}


def interval(rows, mode):
    own = rows["casados"]["median"]
    lines = []
    for name, row in rows.items():
        cells = [f"{1e3 * row[key]:.4g}" for key in ["median", "max", "min"]]
        lines.append([name, *cells, f"{row['median'] / own:.3g}", f"{row['difference']:.1e}"])
    there, theirs = PAPER[mode]
    lines.append(["the paper: acados by call-back", there, "", "", 1, ""])
    lines.append(["the paper: CasADi 3.5.5", theirs, "", "", f"{theirs / there:.3g}", ""])
    return table([mode, "median, ms", "max", "min", "factor", "difference"], lines)


def write(results, path):
    chains, orbit, intervals = results["chains"], results["orbit"], results["intervals"]
    parts = [HEAD.format(casadi=ca.__version__, machine=results.get("machine", ""), date=results.get("date", ""))]
    for number, setting in enumerate(SETTINGS, 1):
        if not any(key.endswith(setting) for key in chains):
            continue
        draw(chains, setting)
        words = CHAIN.format(number=number, setting=SETTINGS[setting], name=setting)
        parts += [words, chain(chains, setting), AGREE.format(agreement(chains, setting))]
    if results.get("peers"):
        parts.append(peers(results))
    parts += [GOALS, goals(chains, orbit, intervals)]
    if orbit:
        parts += [ORBIT, orbits(orbit)]
        if {WHOLE, DIRECT} <= ran(orbit).keys():
            parts.append(SHARE.format(orbit[WHOLE]["total"] / orbit[DIRECT]["total"]))
    if intervals:
        parts += [INTERVAL, *[interval(rows, mode) for mode, rows in intervals.items()], DIFFERENCES]
    if results.get("calls"):
        rows = [[name, *[f"{1e-3 * t:.2f}" for t in times], f"{1e-3 * (times[1] - times[0]):.2f}"] for name, times in results["calls"].items()]
        parts += [CALLS, table(["", "Rust, µs", "exported", "exported, known", "difference"], rows)]
    if results.get("builds"):
        rows = [[name, f"{b['seconds']:.0f}" if b["seconds"] else "", f"{b['bytes'] / 1e6:.2f}"] for name, b in results["builds"].items()]
        parts += [BUILDS, table(["library", "CPU seconds of the build", "MB"], rows)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n\n".join(part.strip() for part in parts) + "\n")


def machine():
    with open("/proc/cpuinfo") as file:
        names = [line.split(":")[1].strip() for line in file if line.startswith("model name")]
    return f"{names[0] if names else platform.processor()}, {len(names)} cores"


HEAD = """
# The experiments of the paper, run again

Frey, De Schutter and Diehl, "Fast integrators with sensitivity propagation for use in CasADi",
compare integrators in IPOPT on a chain of masses (figures 1 and 2) and on the power-optimal orbit
of an aircraft (tables 1 to 3). This page is written by

```sh
examples/casadi/paper.py
```

which needs CasADi and matplotlib; acados takes part where `ACADOS_SOURCE_DIR` says where it is.
It was written with CasADi {casadi} on {machine}, {date}.

The machine did other work at the same time. So all times are CPU seconds of the process on one
thread, of runs by turns, one of each after the other; each number is the median of five runs, of
fewer where they are slow. Runs of the solvers of casados are twenty in a row, with what makes the
problem; the share of functions is what they measure themselves. Ratios of numbers of one table are
what holds elsewhere.

Functions of IPOPT are `nlp_f`, `nlp_g` and their derivatives; the rest is IPOPT and MUMPS, with the
order by minimum degree and no scaling, the same for all. Four forms of casados are in IPOPT:

| | |
| --- | --- |
| whole problem | `nlpsol("s", "ipopt", "lib.so")`: costs, constraints and dynamics in the library |
| horizon | costs and constraints by CasADi, all 40 intervals by one call of `export_horizon!` |
| intervals | the same with 40 calls of `export!`, by which CasADi calls the library |
| call-backs | the same with Python in between, what the paper does with acados' integrators |

Libraries were measured one after the other, and what has not changed since an earlier run was not
run again. Sizes of the chain without a column were not run.
"""

CHAIN = """
## Figure {number}: the chain of masses, {setting}

![milliseconds of an iteration over masses](paper/chain_{name}.svg)

Gauss-Legendre methods, but for RK4 with four steps in an interval and for CVODES and IDAS with a
tolerance of 1e-8. An iteration with a star is one of three, after which IPOPT was stopped. The
solvers of casados and acados are others than IPOPT: their iterations are their own. With `direct
collocation` stages are variables, of which MUMPS has many. The whole problem with RK4 is a second
one of the same library, which CasADi takes as an expression.
"""

AGREE = """
Whole problem, horizon, intervals and CasADi's integrator solve one discrete problem: the largest
relative difference of their objectives is {:.1e}.
"""

PEERS = """
## acados in IPOPT, by call-backs

What the paper is about: acados' implicit integrator with its derivatives of first and second order,
called from IPOPT through Python. CasADi's integrator of the same method ran by turns with it, and
is what these rows have in common with the figures. Numbers are as there: milliseconds of an
iteration, of its functions, and iterations. acados' own SQP is Gauss-Newton, with HPIPM after
partial condensing. `examples/casadi/paper.py --peers` writes this section without a library of
casados: medians of three runs, of one where it takes more than six seconds.

acados {version}, {machine}, {date}. Other programs had a load average of {load}: CPU seconds of
each program are more than on a quiet machine, so that ratios within a row are what holds.
"""

GOALS = """
## Ratios

Times of the slower one over those of the faster one, with whole runs to a tolerance of 1e-6. The
last column compares functions of one iteration in IPOPT with those of the interior point of
casados, which calls them itself.
"""

ORBIT = """
## Table 1: the orbit of the aircraft

40 intervals with one step of Radau IIA, four stages; from the guess `guess_dc`, to 1e-8. The
objective of the reference is −3.260987295. In the whole problem and in the interior point of
casados the tension at a node is where the stages of the integrator continue to, which moves the
optimum by 8e-7; elsewhere it solves the equations at the node. IPOPT relaxes bounds by 1e-8,
casados does not.
"""

SHARE = """
The whole problem takes {:.2f} of the time of direct collocation.
"""

INTERVAL = """
## Tables 2 and 3: simulation and Jacobian of the 40 intervals

Of the optimal orbit, each interval in CasADi by itself: the median of its times, then median,
largest and smallest of the 40 intervals. Inputs change from call to call, so that nothing is found
in the cache. The last column is the largest difference of an entry from an independent reference in
numpy of the same step, relative to entries above one. IDAS integrates to 1e-10: what differs is the
error of the single step, which the others have in common.
"""

DIFFERENCES = """
The paper's numbers are of a laptop of 2022, of acados' integrator through a call-back in Python,
and of the integrator of CasADi 3.5.5 that it was compared with.
"""

CALLS = """
## An exported call

A call of Rust and one through the functions that CasADi calls, in a loop of Rust by turns, at
inputs that are new each time; and the exported one again at the same inputs, which the cache knows.
The shortest of thousands, each kind with a cache that has seen no other. Of the chain with the
largest library that was there.
"""

BUILDS = """
## Libraries

Each has one model with one method as integrator, horizon and whole problem, and the solvers of
casados that the tables name. RK4 is beside it as an integrator, in those with two stages as a whole
problem, too. What a library of one model has is `alone`: neither solvers nor RK4, for the size with
the largest library. The aircraft is `awe`. Seconds are CPU seconds of a build by one thread, after everything that they
share was there.
"""
