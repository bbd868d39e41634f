"""All intervals of a horizon in one call, against one after the other."""

import unittest

import casadi
import numpy as np
from test_integrator import external, full, integrations

N = 7


def points():
    rng = np.random.default_rng(7)
    return rng.uniform(-1, 1, (4, N)), rng.uniform(-2, 2, (1, N)), rng.uniform(-1, 1, (4, N))


class Horizon(unittest.TestCase):
    """Lanes of registers compute the same discrete map: to rounding."""

    def derivatives(self, ends):
        x, u, l = casadi.MX.sym("x", 4, N), casadi.MX.sym("u", 1, N), casadi.MX.sym("l", 4, N)
        w = casadi.vertcat(casadi.vec(x), casadi.vec(u))
        xf = ends(x, u)
        hessian, gradient = casadi.hessian(casadi.dot(l, xf), w)
        outputs = [xf, casadi.jacobian(casadi.vec(xf), w), gradient, hessian]
        return casadi.Function("f", [x, u, l], outputs)

    def test_as_single_intervals(self):
        one, many = external("pendulum"), external("pendulums")
        columns = lambda x: casadi.horzsplit(x)
        single = self.derivatives(
            lambda x, u: casadi.horzcat(*[one(a, b, casadi.MX(0, 1)) for a, b in zip(columns(x), columns(u))])
        )
        together = self.derivatives(lambda x, u: many(x, u, casadi.MX(0, N)))
        for a, b in zip(single(*points()), together(*points())):
            np.testing.assert_allclose(full(a), full(b), rtol=1e-12, atol=1e-13)

    def test_blocks(self):
        jac, second = external("jac_pendulums"), external("jac_adj1_pendulums")
        self.assertEqual(jac.sparsity_in(3).nnz(), 0)
        for f, index, block in [(jac, 0, external("jac_pendulum")), (second, 0, external("jac_adj1_pendulum"))]:
            # A model as an equation in explicit and in implicit form has one pattern.
            pattern = casadi.diagcat(*[block.sparsity_out(index)] * N)
            self.assertEqual(f.sparsity_out(index), pattern)

    def test_one_call_for_all(self):
        x, u, l = points()
        functions = [external("pendulums"), external("jac_pendulums"), external("jac_adj1_pendulums")]
        before = integrations("pendulums")
        functions[2](x, u, casadi.DM(0, N), 0, l, 0, 0, 0)
        functions[1](x, u, casadi.DM(0, N), 0)
        functions[0](x, u, casadi.DM(0, N))
        self.assertEqual(integrations("pendulums") - before, N)

    def test_one_that_fails_fails_all(self):
        F = external("roots")
        F(np.ones((1, 5)), casadi.DM(0, 5), casadi.DM(0, 5))
        with self.assertRaises(RuntimeError):
            F(np.array([[1.0, 1.0, -1.0, 1.0, 1.0]]), casadi.DM(0, 5), casadi.DM(0, 5))


if __name__ == "__main__":
    unittest.main()
