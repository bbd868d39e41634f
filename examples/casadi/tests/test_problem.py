"""A whole problem of casados in CasADi's solvers, against those of casados and against differences."""

import ctypes
import unittest

import casadi
import numpy as np
from test_integrator import LIBRARY, RUST, differences, external, full, integrations

N, STAGE = 25, 5
CONTROLS = slice(4, N * STAGE, STAGE)


def bounds():
    return external("nlp_bounds")()


def point(seed):
    rng = np.random.default_rng(seed)
    n, m = external("nlp_g").nnz_in(0), external("nlp_g").nnz_out(0)
    return rng.uniform(-0.5, 0.5, n), rng.uniform(-1, 1, m)


def gradient(x, sigma, mu):
    return full(external("nlp_grad")(x, casadi.DM(0, 1), sigma, mu)[2]).ravel()


class Derivatives(unittest.TestCase):
    """By central differences of the values: eight digits."""

    def test_dimensions(self):
        x, mu = point(1)
        self.assertEqual(len(x), N * STAGE + 4)
        # Ends of intervals, two path constraints and one at the end.
        self.assertEqual(len(mu), N * 6 + 1)

    def test_first(self):
        x, _ = point(1)
        p = casadi.DM(0, 1)
        f, g = external("nlp_f"), external("nlp_g")
        np.testing.assert_allclose(
            full(external("nlp_grad_f")(x, p)[1]).ravel(),
            differences(lambda x: full(f(x, p)), x).ravel(),
            rtol=1e-8,
            atol=1e-8,
        )
        jac = external("nlp_jac_g")(x, p)[1]
        expected = differences(lambda x: full(g(x, p)), x)
        np.testing.assert_allclose(full(jac), expected, rtol=1e-8, atol=1e-8)
        f_and_g = external("nlp")(x, p)
        np.testing.assert_array_equal(full(f_and_g[0]), full(f(x, p)))
        np.testing.assert_array_equal(full(f_and_g[1]), full(g(x, p)))

    def test_gradient_of_the_lagrangian(self):
        x, mu = point(2)
        p = casadi.DM(0, 1)
        expected = 0.7 * full(external("nlp_grad_f")(x, p)[1]).ravel()
        expected += full(external("nlp_jac_g")(x, p)[1]).T @ mu
        np.testing.assert_allclose(gradient(x, 0.7, mu), expected, rtol=1e-13, atol=1e-13)

    def test_second(self):
        """With a factor of the objective, without one, and with none of it."""
        x, mu = point(3)
        for sigma in [1.0, 0.3, 0.0]:
            upper = full(external("nlp_hess_l")(x, casadi.DM(0, 1), sigma, mu))
            self.assertTrue((np.tril(upper, -1) == 0).all())
            hessian = upper + np.triu(upper, 1).T
            expected = differences(lambda x: gradient(x, sigma, mu), x)
            np.testing.assert_allclose(hessian, expected, rtol=1e-7, atol=1e-7)


class Solvers(unittest.TestCase):
    def own(self):
        """Objectives by sequential quadratic programming and interior point, and controls."""
        own = np.zeros(27)
        self.assertEqual(RUST.own_solution(own.ctypes.data_as(ctypes.POINTER(ctypes.c_double))), 0)
        return own

    def solve(self, plugin, options):
        solver = casadi.nlpsol("s", plugin, LIBRARY, options)
        given = bounds()
        solution = solver(**{name: given[name] for name in ["lbx", "ubx", "x0", "lbg", "ubg"]})
        self.assertTrue(solver.stats()["success"], solver.stats()["return_status"])
        return float(solution["f"]), full(solution["x"]).ravel()

    def test_ipopt_and_those_of_casados_agree(self):
        own = self.own()
        options = {"print_time": False, "ipopt": {"print_level": 0, "tol": 1e-11, "bound_relax_factor": 0}}
        f, x = self.solve("ipopt", options)
        # Conditions of optimality to 1e-10, over a Hessian of the controls of 0.001 (0.02 times the
        # length of an interval).
        np.testing.assert_allclose([f, f], own[:2], rtol=1e-8)
        np.testing.assert_allclose(x[CONTROLS], own[2:], atol=1e-6)
        # Both bounds of a path constraint are active.
        g = full(external("nlp_g")(x, casadi.DM(0, 1))).ravel()
        np.testing.assert_allclose([g[4:-1:6].min(), g[4:-1:6].max()], [-0.4, 1.5], atol=1e-8)

    def test_another_plugin(self):
        """Of `nlp` and its derivatives CasADi makes what other solvers ask for."""
        nlp, given = external("nlp"), bounds()
        x = casadi.MX.sym("x", nlp.size_in(0))
        f, g = nlp(x, casadi.MX(0, 1))
        options = {"print_time": False, "print_header": False, "print_iteration": False, "print_status": False}
        options |= {"qpsol": "qrqp", "tol_pr": 1e-9, "tol_du": 1e-9}
        options["qpsol_options"] = {"print_iter": False, "print_header": False, "error_on_fail": False}
        solver = casadi.nlpsol("s", "sqpmethod", {"x": x, "f": f, "g": g}, options)
        found = float(solver(**{name: given[name] for name in ["lbx", "ubx", "x0", "lbg", "ubg"]})["f"])
        np.testing.assert_allclose(found, self.own()[1], rtol=1e-7)

    def test_both_forms_of_derivatives(self):
        x, mu = point(6)
        p = casadi.DM(0, 1)
        blocks = external("jac_adj1_nlp")(x, p, 0, 0, 0.8, mu, 0, 0)
        upper = full(external("nlp_hess_l")(x, p, 0.8, mu))
        np.testing.assert_array_equal(full(blocks[0]), upper + np.triu(upper, 1).T)
        jac = external("jac_nlp")(x, p, 0, 0)
        np.testing.assert_array_equal(full(jac[0]).T, full(external("nlp_grad_f")(x, p)[1]))
        np.testing.assert_array_equal(full(jac[2]), full(external("nlp_jac_g")(x, p)[1]))
        np.testing.assert_allclose(full(blocks[5]).T, full(jac[2]), rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(full(blocks[4]), full(jac[0]).T, rtol=1e-12, atol=1e-13)
        adjoint = external("adj1_nlp")(x, p, 0, 0, 0.8, mu)[0]
        np.testing.assert_array_equal(full(adjoint).ravel(), gradient(x, 0.8, mu))

    def test_what_is_known_is_not_computed_again(self):
        x, mu = point(5)
        p = casadi.DM(0, 1)
        # With the last of them all memory goes.
        functions = [external(name) for name in ["nlp_hess_l", "nlp_jac_g", "nlp_grad_f"]]
        before = integrations("nlp")
        for function, arguments in zip(functions, [(x, p, 1, mu), (x, p), (x, p)]):
            function(*arguments)
        # Values and gradient come with the Hessian.
        self.assertEqual(integrations("nlp") - before, N)

    def test_values_come_with_the_derivatives_that_follow(self):
        """Where derivatives were asked for at the last point, they are computed with the values."""
        p = casadi.DM(0, 1)
        g, jac = external("nlp_g"), external("nlp_jac_g")
        counts, last = [], integrations("nlp")
        for seed, functions in [(7, [g, jac]), (8, [g, jac]), (9, [g]), (10, [g])]:
            values = [full(function(point(seed)[0], p)[0] if function is jac else function(point(seed)[0], p)) for function in functions]
            for value in values:
                # However they were computed: sums of other orders differ by rounding.
                np.testing.assert_allclose(value, values[0], rtol=1e-13, atol=1e-14)
            counts.append(integrations("nlp") - last)
            last = integrations("nlp")
        # Stages are those of the values, where these came first.
        self.assertEqual(counts, [N, N, N, N])

    def test_derivatives_of_known_stages(self):
        """Jacobian and Hessian after values, and at once."""
        p, names = casadi.DM(0, 1), ["nlp_f", "nlp_g", "nlp_grad_f", "nlp_jac_g", "nlp_hess_l"]
        functions = {name: external(name) for name in names}

        def call(name, x, mu):
            more = (0.7, mu) if name == "nlp_hess_l" else ()
            return full(functions[name].call([x, p, *more])[-1])

        last = integrations("nlp")
        for seed in range(11, 14):
            x, mu = point(seed)
            after = [call(name, x, mu) for name in names]
            self.assertEqual(integrations("nlp") - last, N)
            # The last point is forgotten.
            call("nlp_f", point(seed + 10)[0], mu)
            alone = [call(name, x, mu) for name in reversed(names)][::-1]
            self.assertEqual(integrations("nlp") - last, 3 * N)
            last = integrations("nlp")
            for a, b in zip(after, alone):
                np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13)

    def test_intervals_without_memory_of_stages(self):
        """Where intervals are integrated one by one, derivatives come with the values."""
        p, n = casadi.DM(0, 1), external("slide").size1_in(0)
        g, jac, hess = external("slide_g"), external("slide_jac_g"), external("slide_hess_l")
        counts, last = [], integrations("slide")
        at, mu = lambda seed: np.random.default_rng(seed).uniform(-1, 1, n), np.ones(g.size1_out(0))
        for seed, asked in [(1, "gj"), (2, "gj"), (3, "g"), (4, "g"), (5, "gh")]:
            for name in asked:
                {"g": lambda: g(at(seed), p), "j": lambda: jac(at(seed), p), "h": lambda: hess(at(seed), p, 1, mu)}[name]()
            counts.append(integrations("slide") - last)
            last = integrations("slide")
        self.assertEqual(counts, [8, 4, 4, 4, 8])

    def test_names_of_states_and_controls(self):
        trajectory = external("slide_trajectory")
        names = ["x", "u", "x_place", "x_speed", "u_push"]
        self.assertEqual([trajectory.name_out(i) for i in range(trajectory.n_out())], names)
        # Of the places of all variables: which of them a state is.
        places = trajectory(x=list(range(trajectory.size1_in(0))))
        np.testing.assert_array_equal(full(places["x_speed"]), [[6 * k + 2 for k in range(5)], [6 * k + 3 for k in range(5)]])
        np.testing.assert_array_equal(full(places["u_push"]), [[6 * k + 4 for k in range(4)], [6 * k + 5 for k in range(4)]])
        np.testing.assert_array_equal(full(places["x"])[:2], full(places["x_place"]))
        bounds = external("slide_bounds")()
        np.testing.assert_array_equal(full(trajectory(x=bounds["ubx"])["u_push"]), np.full((2, 4), 2.0))


if __name__ == "__main__":
    unittest.main()
