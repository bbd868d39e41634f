"""Steps of SciPy's DOP853 on the smooth problems of `bin/smooth.rs`: accepted steps, evaluations.

    python3 benches/error_control/dop853.py        # SciPy 1.17
"""

import json
import pathlib
import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import solve_banded

DATA = pathlib.Path(__file__).resolve().parents[2] / "tests" / "data" / "ivp"
VIBRATIONS = json.loads((DATA / "vibrations.json").read_text())
ENDS = json.loads((DATA / "ends.json").read_text())


def beam(t, x):
    n = len(x) // 2
    angle, rate = x[:n], x[n:]
    pull = 1.5 * np.sin(t) ** 2 if t <= np.pi else 0.0
    padded = np.concatenate(([-angle[0]], angle, [angle[-1]]))
    moment = n**4 * (padded[:-2] - 2 * angle + padded[2:]) + n**2 * pull * (np.cos(angle) + np.sin(angle))
    diagonal = np.full(n, 2.0)
    diagonal[0], diagonal[-1] = 1.0, 3.0
    sin, cos = np.sin(np.diff(angle)), np.cos(np.diff(angle))
    right = rate**2
    right[1:] -= sin * moment[:-1]
    right[:-1] += sin * moment[1:]
    bands = np.zeros((3, n))
    bands[0, 1:], bands[1], bands[2, :-1] = -cos, diagonal, -cos
    u = solve_banded((1, 1), bands, right)
    acceleration = diagonal * moment
    acceleration[1:] += -cos * moment[:-1] - sin * u[:-1]
    acceleration[:-1] += -cos * moment[1:] + sin * u[1:]
    return np.concatenate((rate, acceleration))


def spring_pendulum(t, x):
    length = np.hypot(x[0], x[1])
    pull = 1e5 * (length - 1) / length
    return np.array([x[2], x[3], -pull * x[0], -pull * x[1] - 9.81])


def kepler(t, x):
    cube = (x[0] ** 2 + x[1] ** 2) ** 1.5
    return np.array([x[2], x[3], -x[0] / cube, -x[1] / cube])


def populations(t, x):
    return np.array([x[0] * (1 - x[1]), x[1] * (x[0] - 1)])


def oscillator(t, x):
    return np.array([x[1], -x[0]])


def rope(t, x):
    horizontal, vertical = np.diff(x[:5], prepend=0.0), np.diff(x[5:10], prepend=0.0)
    length = np.hypot(horizontal, vertical)
    pull = 1e5 * (length - 0.2) / length
    force = [np.append(pull * horizontal, 0.0), np.append(pull * vertical, 0.0)]
    return np.concatenate((x[10:], 5 * np.diff(force[0]), 5 * np.diff(force[1]) - 9.81))


def pleiades(t, x):
    horizontal, vertical = x[:7] - x[:7, None], x[7:14] - x[7:14, None]
    cube = (horizontal**2 + vertical**2) ** 1.5
    np.fill_diagonal(cube, 1.0)
    masses = np.arange(1.0, 8.0)
    return np.concatenate((x[14:], (horizontal / cube) @ masses, (vertical / cube) @ masses))


def arenstorf(t, x):
    mu = 0.012277471
    d1 = ((x[0] + mu) ** 2 + x[1] ** 2) ** 1.5
    d2 = ((x[0] - 1 + mu) ** 2 + x[1] ** 2) ** 1.5
    a = x[0] + 2 * x[3] - (1 - mu) * (x[0] + mu) / d1 - mu * (x[0] - 1 + mu) / d2
    b = x[1] - 2 * x[2] - (1 - mu) * x[1] / d1 - mu * x[1] / d2
    return np.array([x[2], x[3], a, b])


def of(name):
    return VIBRATIONS[name]["x0"]


PROBLEMS = [
    ("beam, n = 40", beam, np.zeros(80), 5.0),
    ("beam, n = 40, to π", beam, np.zeros(80), np.pi),
    ("beam, n = 10", beam, np.zeros(20), 5.0),
    ("Kepler", kepler, of("kepler"), 20.0),
    ("populations", populations, of("populations"), 40.0),
    ("spring pendulum", spring_pendulum, of("spring_pendulum"), 3.0),
    ("rope", rope, of("rope"), 1.0),
    ("oscillator", oscillator, [1.0, 0.0], 200 * np.pi),
    ("Arenstorf", arenstorf, [0.994, 0.0, 0.0, -2.00158510637908252240537862224], 17.0652165601579625588917206249),
    ("Pleiades", pleiades, ENDS["pleiades"]["x0"][:28], 3.0),
]

for name, slope, x0, end in PROBLEMS:
    for tolerance in [1e-6, 1e-8, 1e-10, 1e-12]:
        run = solve_ivp(slope, (0, end), x0, "DOP853", rtol=tolerance, atol=tolerance)
        print(f"| {name} | {tolerance:.0e} | {len(run.t) - 1} | {run.nfev} |", flush=True)
