"""Integrators of casados as functions of CasADi, against CasADi's own and against the calls of Rust."""

import ctypes
import gc
import os
import pathlib
import unittest

import casadi
import numpy as np

LIBRARY = str(pathlib.Path(__file__).resolve().parent.parent / "target" / "debug" / "libtests.so")
RUST = ctypes.CDLL(LIBRARY)
X0, U, LAMBDA = np.array([0.1, 0.4, -0.3, 0.7]), np.array([1.5]), np.array([0.3, -0.2, 0.7, 1.1])
# What a difference of second order loses: h² of the third derivative and ε/h.
STEP = 6e-6


def external(name):
    return casadi.external(name, LIBRARY)


def integrations(name):
    count = getattr(RUST, f"{name}_integrations")
    count.restype = ctypes.c_longlong
    return count()


def column(values):
    return casadi.DM(np.asarray(values, dtype=float).reshape(-1, 1))


def full(value):
    return np.array(casadi.DM(value).full())


def differences(f, at):
    """The Jacobian of a function by central differences."""
    columns = []
    for i in range(len(at)):
        h = STEP * max(1.0, abs(at[i]))
        ahead, behind = at.copy(), at.copy()
        ahead[i] += h
        behind[i] -= h
        columns.append((f(ahead) - f(behind)).ravel() / (ahead[i] - behind[i]))
    return np.array(columns).T


def pendulum_of_casadi():
    x, u = casadi.SX.sym("x", 4), casadi.SX.sym("u")
    s, c = casadi.sin(x[1]), casadi.cos(x[1])
    mass = 1.0 + 0.1 - 0.1 * c * c
    acceleration = (u - 0.08 * s * x[3] * x[3] + 0.981 * c * s) / mass
    angular = (u * c - 0.08 * c * s * x[3] * x[3] + 10.791 * s) / (0.8 * mass)
    return {"x": x, "u": u, "ode": casadi.vertcat(x[2], x[3], acceleration, angular)}


def integrator_of_casadi(plugin, **options):
    return casadi.integrator("I", plugin, pendulum_of_casadi(), 0, 0.05, options)


def same_order_of_casadi():
    """Gauss-Legendre with two stages and two steps, to rounding."""
    newton = {"abstol": 1e-14, "max_iter": 50}
    options = {"number_of_finite_elements": 2, "interpolation_order": 2, "collocation_scheme": "legendre"}
    return integrator_of_casadi("collocation", rootfinder="newton", rootfinder_options=newton, **options)


class Values(unittest.TestCase):
    def test_bits_of_the_call_of_rust(self):
        F = external("pendulum")
        to = np.zeros(40)
        pointer = ctypes.POINTER(ctypes.c_double)
        args = [a.ctypes.data_as(pointer) for a in (X0, U, LAMBDA, to)]
        self.assertEqual(RUST.reference(*args), 0)
        xf = full(F(X0, U, column([]))).ravel()
        np.testing.assert_array_equal(xf, to[:4])
        blocks = [full(block) for block in F.jacobian()(X0, U, column([]), xf)]
        np.testing.assert_array_equal(blocks[0], to[4:20].reshape(4, 4).T)
        np.testing.assert_array_equal(blocks[1], to[20:24].reshape(4, 1))
        second = external("jac_adj1_pendulum")(X0, U, column([]), 0, LAMBDA, 0, 0, 0)
        np.testing.assert_array_equal(full(second[0]), to[24:].reshape(4, 4).T)

    def test_same_method_of_casadi(self):
        """Value, Jacobian and Hessian of the same discrete map: 1e-14 of Newton's method times
        condition numbers of some hundreds."""
        ours, theirs = external("pendulum"), same_order_of_casadi()
        x, u, l = casadi.MX.sym("x", 4), casadi.MX.sym("u"), casadi.MX.sym("l", 4)
        w = casadi.vertcat(x, u)

        def derivatives(xf):
            inner = casadi.dot(l, xf)
            hessian, gradient = casadi.hessian(inner, w)
            outputs = [xf, casadi.jacobian(xf, w), gradient, hessian]
            return [full(v) for v in casadi.Function("f", [x, u, l], outputs)(X0, U, LAMBDA)]

        for a, b in zip(derivatives(ours(x, u, casadi.MX(0, 1))), derivatives(theirs(x0=x, u=u)["xf"])):
            np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-11)

    def test_explicit_method_of_casadi(self):
        ours = external("pendulum_rk4")
        theirs = integrator_of_casadi("rk", number_of_finite_elements=3)
        a, b = ours(X0, U, column([])), theirs(x0=X0, u=U)["xf"]
        np.testing.assert_allclose(full(a), full(b), rtol=1e-14, atol=1e-15)
        jac = full(ours.jacobian()(X0, U, column([]), 0)[0])
        expected = differences(lambda x: full(ours(x, U, column([]))), X0)
        np.testing.assert_allclose(jac, expected, rtol=1e-8, atol=1e-8)

    def test_null_inputs_are_zeros(self):
        F = external("pendulum")
        self.assertEqual(full(F(x0=X0)["xf"]).tolist(), full(F(X0, 0, column([]))).tolist())

    def test_adaptive_steps_are_frozen(self):
        """To the tolerance the solution; and to rounding the Jacobian of what the steps give."""
        F = external("adaptive")
        exact = casadi.integrator("I", "cvodes", pendulum_of_casadi(), 0, 0.5, {"abstol": 1e-13, "reltol": 1e-13})
        at = np.array([0.0, 0.5, 0.0, 0.0])
        np.testing.assert_allclose(full(F(at, 1, column([]))), full(exact(x0=at, u=1)["xf"]), atol=1e-7)
        jac = full(F.jacobian()(X0, U, column([]), 0)[0])
        expected = differences(lambda x: full(F(x, U, column([]))), X0)
        np.testing.assert_allclose(jac, expected, rtol=1e-7, atol=1e-7)


class Algebraic(unittest.TestCase):
    """A model with algebraic state, parameters and integrals."""

    AT = [np.array([0.4, -0.2, 1.0]), np.array([0.7]), np.array([2.0, 0.5])]

    def value(self, w):
        out = external("spring")(w[:3], w[3:4], w[4:])
        return np.concatenate([full(v).ravel() for v in out])

    def test_jacobian_is_that_of_the_values(self):
        blocks = external("spring").jacobian()(*self.AT, 0, 0)
        ours = np.vstack([np.hstack([full(b) for b in blocks[3 * i : 3 * i + 3]]) for i in range(2)])
        expected = differences(self.value, np.concatenate(self.AT))
        np.testing.assert_allclose(ours, expected, rtol=1e-8, atol=1e-8)

    def test_hessian_is_that_of_the_gradient(self):
        weights = [np.array([0.3, -0.4, 0.9]), np.array([1.2, -0.7])]
        adjoint, second = external("adj1_spring"), external("jac_adj1_spring")

        def gradient(w):
            out = adjoint(w[:3], w[3:4], w[4:], 0, 0, *weights)
            return np.concatenate([full(v).ravel() for v in out])

        w = np.concatenate(self.AT)
        blocks = second(*self.AT, 0, 0, *weights, 0, 0, 0)
        rows = [blocks[7 * i : 7 * i + 7] for i in range(3)]
        ours = np.vstack([np.hstack([full(b) for b in row[:3]]) for row in rows])
        np.testing.assert_allclose(ours, differences(gradient, w), rtol=1e-8, atol=1e-8)
        np.testing.assert_array_equal(ours, ours.T)
        # By the weights it is the transposed Jacobian.
        jac = external("spring").jacobian()(*self.AT, 0, 0)
        for i in range(3):
            for j in range(2):
                np.testing.assert_allclose(full(rows[i][5 + j]), full(jac[3 * j + i]).T, rtol=1e-13, atol=1e-14)
        # The gradient is what the Jacobian gives.
        expected = sum(full(jac[3 * j + 0]).T @ weights[j] for j in range(2))
        np.testing.assert_allclose(gradient(w)[:3], expected, rtol=1e-13, atol=1e-13)


def spring_of_casadi(plugin, **options):
    x, u, z, p = casadi.SX.sym("x", 3), casadi.SX.sym("u"), casadi.SX.sym("z"), casadi.SX.sym("p", 2)
    ode = casadi.vertcat(x[1], u - z, -p[1] * u * u)
    alg = z + 0.1 * z**3 - p[0] * x[0]
    quad = casadi.vertcat(0.5 * x[0] ** 2 + 0.1 * u**2, z * x[1])
    dae = {"x": x, "z": z, "u": u, "p": p, "ode": ode, "alg": alg, "quad": quad}
    return casadi.integrator("I", plugin, dae, 0, 0.3, options)


class OutputsOfCasadi(unittest.TestCase):
    """Integrals and algebraic states by integrators of CasADi."""

    AT = Algebraic.AT

    def test_integrals_of_the_same_method(self):
        """Values, Jacobian and Hessian of the same discrete map, Radau IIA with three stages and two
        steps: 1e-14 of Newton's method times condition numbers of some hundreds."""
        theirs = spring_of_casadi(
            "collocation",
            number_of_finite_elements=2,
            interpolation_order=3,
            collocation_scheme="radau",
            rootfinder="newton",
            rootfinder_options={"abstol": 1e-14, "max_iter": 50},
        )
        ours = external("spring")
        x, u, p, l = [casadi.MX.sym(*name) for name in [("x", 3), ("u", 1), ("p", 2), ("l", 5)]]
        w = casadi.vertcat(x, u, p)

        def derivatives(outputs):
            y = casadi.vertcat(*outputs)
            hessian, gradient = casadi.hessian(casadi.dot(l, y), w)
            f = casadi.Function("f", [x, u, p, l], [y, casadi.jacobian(y, w), gradient, hessian])
            return [full(v) for v in f(*self.AT, [0.3, -0.4, 0.9, 1.2, -0.7])]

        end = theirs(x0=x, u=u, p=p, z0=0.5)
        for a, b in zip(derivatives(ours(x, u, p)), derivatives([end["xf"], end["qf"]])):
            np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-11)

    def test_algebraic_states(self):
        """Gauss with two stages and two steps has errors of h⁴ = 5e-4 times derivatives of fifth
        order over 4320: 1e-6 is more than both steps make."""
        exact = spring_of_casadi("idas", abstol=1e-12, reltol=1e-12)
        end = exact(x0=self.AT[0], u=self.AT[1], p=self.AT[2], z0=0.5)
        for a, b in zip(external("spring_z")(*self.AT), [end["xf"], end["zf"], end["qf"]]):
            np.testing.assert_allclose(full(a), full(b), atol=1e-6)


class ConsistentStates(unittest.TestCase):
    """Algebraic states at the end, a function of the states there."""

    AT = Algebraic.AT

    def test_equation_holds_at_the_end(self):
        xf, zf, _ = [full(v).ravel() for v in external("spring_z")(*self.AT)]
        residual = zf[0] + 0.1 * zf[0] ** 3 - self.AT[2][0] * xf[0]
        self.assertLess(abs(residual), 1e-15)

    def test_nobody_solves_for_what_is_not_wanted(self):
        x, u, p = casadi.MX.sym("x", 3), casadi.MX.sym("u"), casadi.MX.sym("p", 2)
        ends = external("spring_z")(x, u, p)
        of_states, of_all = [casadi.Function("f", [x, u, p], outputs) for outputs in [[ends[0]], ends]]
        jac = casadi.Function("j", [x, u, p], [casadi.jacobian(ends[0], x)])
        at, counts, last = [self.AT[0] + 0.01, *self.AT[1:]], [], integrations("spring_z")
        for function in [of_states, jac, of_all, of_all, jac]:
            values = function(*at)
            counts.append(integrations("spring_z") - last)
            last = integrations("spring_z")
        # Stages; their derivatives; algebraic states, with the stages that are known.
        self.assertEqual(counts, [1, 0, 1, 0, 0])
        other = external("spring_z")(*[value * (1 + 1e-15) for value in at])
        for a, b in zip(of_all(*at), other):
            np.testing.assert_allclose(full(a), full(b), rtol=1e-12, atol=1e-13)

    def value(self, w):
        out = external("spring_z")(w[:3], w[3:4], w[4:])
        return np.concatenate([full(v).ravel() for v in out])

    def test_jacobian_is_that_of_the_values(self):
        blocks = external("spring_z").jacobian()(*self.AT, 0, 0, 0)
        ours = np.vstack([np.hstack([full(b) for b in blocks[3 * i : 3 * i + 3]]) for i in range(3)])
        expected = differences(self.value, np.concatenate(self.AT))
        np.testing.assert_allclose(ours, expected, rtol=1e-8, atol=1e-8)

    def test_hessian_is_that_of_the_gradient(self):
        weights = [np.array([0.3, -0.4, 0.9]), np.array([1.6]), np.array([1.2, -0.7])]
        adjoint, second = external("adj1_spring_z"), external("jac_adj1_spring_z")

        def gradient(w):
            out = adjoint(w[:3], w[3:4], w[4:], 0, 0, 0, *weights)
            return np.concatenate([full(v).ravel() for v in out])

        w = np.concatenate(self.AT)
        blocks = second(*self.AT, 0, 0, 0, *weights, 0, 0, 0)
        ours = np.vstack([np.hstack([full(b) for b in blocks[9 * i : 9 * i + 3]]) for i in range(3)])
        np.testing.assert_allclose(ours, differences(gradient, w), rtol=1e-8, atol=1e-8)
        jac = external("spring_z").jacobian()(*self.AT, 0, 0, 0)
        expected = sum(full(jac[3 * j]).T @ weights[j] for j in range(3))
        np.testing.assert_allclose(gradient(w)[:3], expected, rtol=1e-13, atol=1e-13)


class Patterns(unittest.TestCase):
    def test_names(self):
        F = external("spring")
        self.assertEqual([F.name_in(i) for i in range(F.n_in())], ["x0", "u", "p"])
        self.assertEqual([F.name_out(i) for i in range(F.n_out())], ["xf", "qf"])

    def test_nobody_depends_on_the_fuel(self):
        jac = external("jac_spring")
        xx = np.array(casadi.DM(jac.sparsity_out(0), 1).full())
        np.testing.assert_array_equal(xx, [[1, 1, 0], [1, 1, 0], [0, 0, 1]])
        # Its second derivatives by control and parameter are the only ones of it.
        self.assertEqual(jac.sparsity_out(1).nnz(), 3)
        xp = np.array(casadi.DM(jac.sparsity_out(2), 1).full())
        np.testing.assert_array_equal(xp, [[1, 0], [1, 0], [0, 1]])

    def test_outputs_as_inputs_are_empty(self):
        jac, second = external("jac_spring"), external("jac_adj1_spring")
        for f, names in [(jac, ["out_xf", "out_qf"]), (second, ["out_xf", "out_adj_x0", "out_adj_p"])]:
            for name in names:
                self.assertEqual(f.sparsity_in(f.index_in(name)).nnz(), 0)

    def test_explicit_steps_reach_one_state_further_each(self):
        """One step of Euler: bidiagonal; an implicit one: lower triangular."""
        euler = np.array(casadi.DM(external("jac_cascade_euler").sparsity_out(0), 1).full())
        np.testing.assert_array_equal(euler, np.eye(4) + np.eye(4, k=-1))
        # `x₁²` is evaluated at the start alone.
        second = np.array(casadi.DM(external("jac_adj1_cascade_euler").sparsity_out(0), 1).full())
        np.testing.assert_array_equal(second, np.diag([0, 1, 1, 0]))
        implicit = np.array(casadi.DM(external("jac_cascade").sparsity_out(0), 1).full())
        np.testing.assert_array_equal(implicit, np.tril(np.ones((4, 4))))

    def test_only_curved_states_have_second_derivatives(self):
        """`x₁²` and `sin x₂`: nothing depends on `x₃`."""
        hessian = np.array(casadi.DM(external("jac_adj1_cascade").sparsity_out(0), 1).full())
        np.testing.assert_array_equal(hessian[3], np.zeros(4))
        np.testing.assert_array_equal(hessian[:3, :3], np.ones((3, 3)))

    def test_differences_see_nothing_outside_of_the_patterns(self):
        for name in ["cascade", "cascade_euler"]:
            F = external(name)
            at = np.array([0.3, -0.4, 0.9, 0.2])
            seen = differences(lambda x: full(F(x, 0.5, column([]))), at)
            pattern = np.array(casadi.DM(external(f"jac_{name}").sparsity_out(0), 1).full())
            self.assertTrue((np.abs(seen[pattern == 0]) < 1e-9).all())
            self.assertTrue((np.abs(seen[pattern == 1]) > 1e-9).all(), seen)


class Cache(unittest.TestCase):
    def test_one_integration_for_all_derivatives(self):
        N = 30
        F = external("pendulum")
        w, l = casadi.MX.sym("w", 5 * N + 4), casadi.MX.sym("l", 4 * N)
        x = [w[5 * k : 5 * k + 4] for k in range(N + 1)]
        g = casadi.vertcat(*[F(x[k], w[5 * k + 4], casadi.MX(0, 1)) - x[k + 1] for k in range(N)])
        nlp_g = casadi.Function("nlp_g", [w], [g])
        nlp_jac = casadi.Function("nlp_jac", [w], [casadi.jacobian(g, w)])
        nlp_hess = casadi.Function("nlp_hess", [w, l], [casadi.hessian(casadi.dot(l, g), w)[0]])
        rng = np.random.default_rng(1)
        at, weights = rng.uniform(-1, 1, 5 * N + 4), rng.uniform(-1, 1, 4 * N)
        before = integrations("pendulum")
        values, jac, hess = full(nlp_g(at)), full(nlp_jac(at)), full(nlp_hess(at, weights))
        self.assertEqual(integrations("pendulum") - before, N)
        # Again, and in another order at another point.
        nlp_hess(at, 2 * weights)
        self.assertEqual(integrations("pendulum") - before, N)
        at = at + 1e-3
        nlp_hess(at, weights), nlp_jac(at), nlp_g(at)
        self.assertEqual(integrations("pendulum") - before, 2 * N)
        self.assertEqual(values.shape, (4 * N, 1))
        np.testing.assert_allclose(jac[:4, :4], full(F.jacobian()(rng_at(1, N)[:4], rng_at(1, N)[4], column([]), 0)[0]))
        np.testing.assert_array_equal(hess, hess.T)

    def test_stages_from_the_cache_give_the_same_derivatives(self):
        """The Hessian after the nominal value, and in one call."""
        F, second = external("spring"), external("jac_adj1_spring")
        at = [np.array([0.41, -0.2, 1.0]), np.array([0.7]), np.array([2.0, 0.5])]
        weights = [np.array([0.3, -0.4, 0.9]), np.array([1.2, -0.7])]
        F(*at)
        after = [full(b) for b in second(*at, 0, 0, *weights, 0, 0, 0)]
        for k in range(5):  # more than there are entries
            F(at[0] + k + 1, *at[1:])
        before = integrations("spring")
        alone = [full(b) for b in second(*at, 0, 0, *weights, 0, 0, 0)]
        self.assertEqual(integrations("spring") - before, 1)
        for a, b in zip(after, alone):
            np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-14)

    def test_as_many_entries_as_there_are(self):
        F = external("spring")
        points = [np.array([0.5 + 0.01 * k, 0.0, 0.0]) for k in range(5)]
        ask = lambda k: F(points[k], 0.1, np.array([2.0, 0.5]))
        before = integrations("spring")
        for k in [0, 1, 2, 3, 3, 2, 1, 0]:
            ask(k)
        self.assertEqual(integrations("spring") - before, 4)
        ask(4)
        ask(0)  # the oldest, which had to go
        self.assertEqual(integrations("spring") - before, 6)


def rng_at(seed, N):
    return np.random.default_rng(seed).uniform(-1, 1, 5 * N + 4)


class Failures(unittest.TestCase):
    def test_no_solution(self):
        F = external("root")
        with self.assertRaises(RuntimeError):
            F(np.array([-1.0]), column([]), column([]))
        # It works at the next point.
        self.assertTrue(np.isfinite(full(F(np.array([4.0]), column([]), column([])))).all())

    def test_what_is_not_a_number(self):
        with self.assertRaises(RuntimeError):
            external("pendulum")(np.array([np.nan, 0, 0, 0]), 0, column([]))

    def test_what_was_refused_leaves_nothing_behind(self):
        """Stages were there for an adjoint whose seed is no number: the next point has its own."""
        F, adjoint = external("pendulum"), external("adj1_pendulum")
        F(X0, U, column([]))
        with self.assertRaises(RuntimeError):
            adjoint(X0, U, column([]), 0, np.full(4, np.nan))
        at, to = X0 + 0.1, np.zeros(40)
        pointer = ctypes.POINTER(ctypes.c_double)
        self.assertEqual(RUST.reference(*[a.ctypes.data_as(pointer) for a in (at, U, LAMBDA, to)]), 0)
        np.testing.assert_array_equal(full(F(at, U, column([]))).ravel(), to[:4])

    def test_options_that_make_no_sense(self):
        with self.assertRaises(RuntimeError):
            external("broken")(X0, U, column([]))

    def test_intervals_without_length(self):
        with self.assertRaises(RuntimeError):
            external("standing")(X0, U, column([]))
        with self.assertRaises(RuntimeError):
            external("standings")(np.tile(X0, (7, 1)).T, np.tile(U, (7, 1)).T, casadi.DM(0, 7))

    def test_backwards_in_time(self):
        """Methods of Gauss are symmetric: a step back leads to where the step began."""
        end = external("pendulum")(X0, U, column([]))
        start = full(external("backwards")(end, U, column([]))).ravel()
        np.testing.assert_allclose(start, X0, rtol=0, atol=1e-14)

    def test_a_panic_stays_inside(self):
        evaluate = RUST.panicking
        self.assertEqual(RUST.panicking_n_in(), 0)
        self.assertEqual(evaluate(None, None, None, None, 0), 1)

    def test_memories(self):
        """Of a number below zero, of nobody, and of one that was given back."""
        pointer = ctypes.POINTER(ctypes.c_double)
        arg = (pointer * 3)(X0.ctypes.data_as(pointer), U.ctypes.data_as(pointer), None)
        to = np.zeros(4)
        res = (pointer * 1)(to.ctypes.data_as(pointer))
        call = lambda memory: RUST.pendulum(arg, res, None, None, memory)
        self.assertEqual([call(-1), call(77), call(2**31 - 1)], [1, 1, 1])
        one, other = RUST.pendulum_checkout(), RUST.pendulum_checkout()
        self.assertNotEqual(one, other)
        self.assertEqual([call(one), call(other)], [0, 0])
        RUST.pendulum_release(one)
        self.assertEqual([call(one), call(other)], [1, 0])
        RUST.pendulum_release(other)
        RUST.pendulum_release(other)
        RUST.pendulum_release(-5)

    def test_nothing_is_wanted(self):
        pointer = ctypes.POINTER(ctypes.c_double)
        arg = (pointer * 3)(X0.ctypes.data_as(pointer), U.ctypes.data_as(pointer), None)
        memory = RUST.pendulum_checkout()
        before = integrations("pendulum")
        self.assertEqual(RUST.pendulum(arg, (pointer * 1)(None), None, None, memory), 0)
        self.assertEqual(integrations("pendulum"), before)
        RUST.pendulum_release(memory)


class Solvers(unittest.TestCase):
    def swing(self, F, N=40):
        """From a small angle to rest: IPOPT by multiple shooting."""
        w = casadi.MX.sym("w", 5 * N + 4)
        x = [w[5 * k : 5 * k + 4] for k in range(N + 1)]
        u = [w[5 * k + 4] for k in range(N)]
        f = sum(casadi.sumsqr(x[k]) + 0.01 * u[k] ** 2 for k in range(N)) + 10 * casadi.sumsqr(x[N])
        g = casadi.vertcat(x[0] - casadi.DM([0.2, 0.5, 0, 0]), *[F(x[k], u[k]) - x[k + 1] for k in range(N)])
        options = {"print_time": False, "ipopt": {"print_level": 0, "tol": 1e-10}}
        solver = casadi.nlpsol("s", "ipopt", {"x": w, "f": f, "g": g}, options)
        solution = solver(x0=0, lbg=0, ubg=0)
        self.assertTrue(solver.stats()["success"])
        return float(solution["f"]), full(solution["x"]).ravel(), solver.stats()["iter_count"]

    def test_ipopt(self):
        """The same discrete problem with CasADi's integrator: same objective, iterates and number of
        them."""
        F, theirs = external("pendulum"), same_order_of_casadi()
        ours = self.swing(lambda x, u: F(x, u, casadi.MX(0, 1)))
        expected = self.swing(lambda x, u: theirs(x0=x, u=u)["xf"])
        # 1e-10 of IPOPT over a Hessian of 0.02.
        np.testing.assert_allclose(ours[0], expected[0], rtol=1e-9)
        np.testing.assert_allclose(ours[1], expected[1], atol=1e-7)
        self.assertEqual(ours[2], expected[2])


class Threads(unittest.TestCase):
    def test_as_one_after_the_other(self):
        N = 200
        F = external("pendulum_rk4")
        x = np.random.default_rng(3).uniform(-1, 1, (4, N))
        u = np.linspace(-1, 1, N).reshape(1, N)
        one = full(F.map(N, "serial")(x, u, casadi.DM(0, N)))
        many = full(F.map(N, "thread", 8)(x + 1e-12, u, casadi.DM(0, N)))
        again = full(F.map(N, "thread", 8)(x, u, casadi.DM(0, N)))
        np.testing.assert_array_equal(one, again)
        np.testing.assert_allclose(one, many, atol=1e-10)


class Leaks(unittest.TestCase):
    def resident(self):
        with open("/proc/self/statm") as statm:
            return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    @unittest.skipUnless(os.path.exists("/proc/self/statm"), "needs /proc")
    def test_loading_again_and_again(self):
        """A client of the spring holds 4 entries and an integrator, some ten thousand bytes: three
        hundred that were not forgotten are more than three million."""

        def use():
            for name in ["spring", "jac_spring", "jac_adj1_spring"]:
                F = external(name)
                F.call([np.ones(F.size_in(i)) for i in range(F.n_in())])
            del F
            gc.collect()

        for _ in range(50):
            use()
        before = self.resident()
        for _ in range(300):
            use()
        self.assertLess(self.resident() - before, 1.5e6)

    @unittest.skipUnless(os.path.exists("/proc/self/statm"), "needs /proc")
    def test_checkouts_and_releases(self):
        """One memory serves them all: a thousand that were not given back are ten million bytes."""
        pointer = ctypes.POINTER(ctypes.c_double)
        x, to = X0.copy(), np.zeros(4)
        arg = (pointer * 3)(x.ctypes.data_as(pointer), U.ctypes.data_as(pointer), None)
        res = (pointer * 1)(to.ctypes.data_as(pointer))

        def use(call):
            memory = RUST.pendulum_checkout()
            x[0] = 1e-6 * call
            self.assertEqual(RUST.pendulum(arg, res, None, None, memory), 0)
            RUST.pendulum_release(memory)
            return memory

        first = use(0)
        # The cache has 512 entries.
        for call in range(1000):
            use(call)
        before = self.resident()
        self.assertEqual({use(call) for call in range(1000, 5000)}, {first})
        self.assertLess(self.resident() - before, 1.5e6)

    @unittest.skipUnless(os.path.exists("/proc/self/statm"), "needs /proc")
    def test_problems_again_and_again(self):
        """A problem of 25 intervals holds more than a hundred thousand bytes."""

        def use():
            for name in ["nlp_g", "nlp_jac_g"]:
                F = external(name)
                F(np.zeros(F.size_in(0)), column([]))
            del F
            gc.collect()

        for _ in range(10):
            use()
        before = self.resident()
        for _ in range(60):
            use()
        self.assertLess(self.resident() - before, 3e6)


if __name__ == "__main__":
    unittest.main()
