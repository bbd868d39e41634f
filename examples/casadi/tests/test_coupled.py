"""A problem with a free duration, a periodic state, soft bounds and a cost of the first state, in
IPOPT and by the interior point of casados."""

import ctypes
import unittest

import casadi
import numpy as np
from test_integrator import RUST, differences, external, full

N = 12
P = casadi.DM(0, 1)


def point(seed):
    rng = np.random.default_rng(seed)
    n, m = external("voyage_g").nnz_in(0), external("voyage_g").nnz_out(0)
    x = rng.uniform(-0.5, 0.5, n)
    x[4] = 2.0  # the duration
    return x, rng.uniform(-1, 1, m)


def pattern(sparsity):
    return np.array(casadi.DM(sparsity, 1).full())


class Layout(unittest.TestCase):
    def test_variables_and_constraints(self):
        """x0 (3), u0 (2), then 3 + 1 of each stage, 2 of the last, and slack: two constraints of
        the soft pair, of which the first has no lower bound, controls of ten stages with both
        sides, a state with both."""
        x, mu = point(1)
        self.assertEqual(len(x), 5 + 4 * (N - 1) + 2 + 3 * N + 2 * 10 + 2)
        self.assertEqual(len(mu), (3 + 4) * N + 10 + 1)

    def test_bounds(self):
        given = {name: full(value).ravel() for name, value in external("voyage_bounds")().items()}
        self.assertEqual([given["lbx"][4], given["ubx"][4]], [0.5, 4.0])
        # Hard at stage 0, soft from stage 2 on: then it is a constraint.
        self.assertEqual([given["lbx"][3], given["ubx"][3]], [-0.7, 0.7])
        self.assertEqual([given["lbx"][5 + 4 + 3], given["ubx"][5 + 4 + 3]], [-np.inf, np.inf])
        self.assertEqual(np.sum((given["lbg"] == -0.7) & (given["ubg"] == 0.7)), 10)
        self.assertEqual(np.sum((given["lbg"] == -2.0) & (given["ubg"] == 0.1)), 1)

    def test_trajectory(self):
        x, _ = point(1)
        states, controls = [full(v) for v in external("voyage_trajectory")(x)]
        self.assertEqual([states.shape, controls.shape], [(3, N + 1), (2, N)])
        np.testing.assert_array_equal(controls[1], np.full(N, x[4]))
        self.assertEqual(states[1, N], states[1, 0])
        np.testing.assert_array_equal(states[:, 1], x[5:8])


class Patterns(unittest.TestCase):
    def test_what_the_graph_knows(self):
        """Nothing depends on fuel, which is linear; a constraint of a velocity and a control has
        these two."""
        stage = pattern(external("voyage_jac_g").sparsity_out(1))[:7, :5]
        expected = [[1, 1, 0, 1, 1], [1, 1, 0, 1, 1], [0, 0, 1, 1, 1]]
        expected += 2 * [[1, 1, 0, 1, 1], [0, 1, 0, 1, 0]]
        np.testing.assert_array_equal(stage, expected)
        hessian = pattern(external("jac_adj1_voyage").sparsity_out(0))
        self.assertEqual(hessian[7, :].sum() + hessian[:, 7].sum(), 0)
        # A cost of the first state may couple all of its elements.
        self.assertEqual(hessian[2, :3].sum(), 3)

    def test_differences_see_nothing_outside_of_the_patterns(self):
        x, mu = point(4)
        seen = differences(lambda x: full(external("voyage_g")(x, P)), x)
        jacobian = pattern(external("voyage_jac_g").sparsity_out(1))
        self.assertLess(np.abs(seen[jacobian == 0]).max(), 1e-10)
        gradient = lambda x: full(external("voyage_grad")(x, P, 1.3, mu)[2])
        hessian = pattern(external("jac_adj1_voyage").sparsity_out(0))
        self.assertLess(np.abs(differences(gradient, x)[hessian == 0]).max(), 1e-9)


class Derivatives(unittest.TestCase):
    """By central differences of the values: eight digits."""

    def test_first(self):
        x, _ = point(1)
        f, g = external("voyage_f"), external("voyage_g")
        value, slope = external("voyage_grad_f")(x, P)
        self.assertEqual(float(value), float(f(x, P)))
        expected = differences(lambda x: full(f(x, P)), x).ravel()
        np.testing.assert_allclose(full(slope).ravel(), expected, rtol=1e-8, atol=1e-8)
        expected = differences(lambda x: full(g(x, P)), x)
        np.testing.assert_allclose(full(external("voyage_jac_g")(x, P)[1]), expected, rtol=1e-8, atol=1e-8)

    def test_second(self):
        x, mu = point(3)
        for sigma in [1.0, 0.3, 0.0]:
            upper = full(external("voyage_hess_l")(x, P, sigma, mu))
            self.assertTrue((np.tril(upper, -1) == 0).all())
            gradient = lambda x: full(external("voyage_grad")(x, P, sigma, mu)[2])
            hessian = upper + np.triu(upper, 1).T
            np.testing.assert_allclose(hessian, differences(gradient, x), rtol=1e-7, atol=1e-7)


class Solvers(unittest.TestCase):
    def test_ipopt_and_that_of_casados_agree(self):
        own = np.zeros(3 * (N + 1) + 1)
        self.assertEqual(RUST.own_voyage(own.ctypes.data_as(ctypes.POINTER(ctypes.c_double))), 0)
        nlp, given = external("voyage"), external("voyage_bounds")()
        x = casadi.MX.sym("x", nlp.size_in(0))
        f, g = nlp(x, casadi.MX(0, 1))
        options = {"print_time": False, "ipopt": {"print_level": 0, "tol": 1e-11, "bound_relax_factor": 0}}
        solver = casadi.nlpsol("s", "ipopt", {"x": x, "f": f, "g": g}, options)
        solution = solver(**given)
        self.assertTrue(solver.stats()["success"], solver.stats()["return_status"])
        # Conditions of optimality to 1e-10, over a Hessian of controls of 0.1 / 12.
        np.testing.assert_allclose(float(solution["f"]), own[0], rtol=1e-8)
        states = full(external("voyage_trajectory")(solution["x"])[0])
        np.testing.assert_allclose(states.T.ravel(), own[1:], atol=1e-6)
        # Some soft bounds are left, some are kept.
        slack = full(solution["x"]).ravel()[5 + 4 * (N - 1) + 2 :]
        self.assertGreater(slack.max(), 1e-3)
        self.assertLess(slack.min(), 1e-6)


if __name__ == "__main__":
    unittest.main()
