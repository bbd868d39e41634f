#!/usr/bin/env python3
"""Writes tests/data/ocp/lqr.json: the control-bounded LQRs of J. Frey et al., "Differentiable nonlinear model predictive
control" (arXiv 2505.01353), table 1.

A = I + 0.2 randn(8, 8), B = randn(8, 4), b = randn(8), x0 = randn(128, 8), from numpy's seed 42, in this order; 20 intervals
of ½ (|x|² + |u|²). Matrices are written row after row.
"""

import json
import pathlib

import numpy

NX, NU, PROBLEMS = 8, 4, 128

numpy.random.seed(42)
a = numpy.eye(NX) + 0.2 * numpy.random.randn(NX, NX)
b = numpy.random.randn(NX, NU)
offset = numpy.random.randn(NX)
x0 = numpy.random.randn(PROBLEMS, NX)
record = {"N": 20, "nx": NX, "nu": NU, "A": a.tolist(), "B": b.tolist(), "b": offset.tolist(), "x0": x0.tolist()}
path = pathlib.Path(__file__).resolve().parents[2] / "tests/data/ocp/lqr.json"
path.write_text(json.dumps(record) + "\n")
