"""Integrators as call-backs in Python, as `casados_integrators` makes them: whatever CasADi wants of
an interval goes through Python, and nominal values are asked for along with derivatives.

Two are behind them: what casados exports, which says what Python takes, and acados' integrator."""

import os

import casadi as ca
import numpy as np


class CallBack(ca.Callback):
    """A function with dense inputs and outputs, that gives functions for derivatives."""

    # CasADi refers to call-backs without keeping them.
    kept = []

    def __init__(self, name, inputs, outputs, evaluate, jacobian=None, reverse=None):
        super().__init__()
        self.names, self.sizes = [list(inputs), list(outputs)], [list(inputs.values()), list(outputs.values())]
        self.evaluate, self.jacobian, self.reverse = evaluate, jacobian, reverse
        self.construct(name, {})
        self.kept.append(self)

    def get_n_in(self):
        return len(self.names[0])

    def get_n_out(self):
        return len(self.names[1])

    def get_name_in(self, index):
        return self.names[0][index]

    def get_name_out(self, index):
        return self.names[1][index]

    def get_sparsity_in(self, index):
        return ca.Sparsity.dense(*self.sizes[0][index])

    def get_sparsity_out(self, index):
        return ca.Sparsity.dense(*self.sizes[1][index])

    def eval(self, arguments):
        return self.evaluate(*[argument.full() for argument in arguments])

    def has_jacobian(self):
        return self.jacobian is not None

    def get_jacobian(self, name, inames, onames, options):
        return self.jacobian(name)

    def has_reverse(self, count):
        return self.reverse is not None and count == 1

    def get_reverse(self, count, name, inames, onames, options):
        return self.reverse(name)


def integrator(engine, nx, nu):
    """The end of an interval, with derivatives of first and second order."""
    inputs = {"x0": (nx, 1), "u": (nu, 1)}
    nominal = inputs | {"out_xf": (nx, 1)}
    adjoint = nominal | {"adj_xf": (nx, 1)}
    gradient = {"adj_x0": (nx, 1), "adj_u": (nu, 1)}
    second = adjoint | {f"out_{name}": size for name, size in gradient.items()}

    def blocks(rows, columns):
        names = [(f"jac_{row}_{column}", (m, n)) for row, (m, _) in rows.items() for column, (n, _) in columns.items()]
        return dict(names)

    def hessian(x, u, _out, seed, *_gradients):
        h, j = engine.hessian(x, u, seed)
        parts = []
        for rows in [slice(nx), slice(nx, nx + nu)]:
            size = len(j.T[rows])
            parts += [h[rows, :nx], h[rows, nx:], np.zeros((size, nx)), j.T[rows]]
        return parts

    def jacobian(x, u, _out):
        j = engine.jacobian(x, u)
        return [j[:, :nx], j[:, nx:]]

    def backward(x, u, _out, seed):
        g = engine.adjoint(x, u, seed)
        return [g[:nx], g[nx:]]

    return CallBack(
        "F",
        inputs,
        {"xf": (nx, 1)},
        lambda x, u: [engine.value(x, u)],
        lambda name: CallBack(name, nominal, blocks({"xf": (nx, 1)}, inputs), jacobian),
        lambda name: CallBack(
            name,
            adjoint,
            gradient,
            backward,
            lambda name: CallBack(name, second, blocks(gradient, adjoint), hessian),
        ),
    )


class Exported:
    """What a library of casados exports."""

    def __init__(self, name, path):
        self.functions = [ca.external(prefix + name, path) for prefix in ["", "jac_", "adj1_", "jac_adj1_"]]

    def call(self, order, **arguments):
        return self.functions[order](**arguments)

    def value(self, x, u):
        return self.call(0, x0=x, u=u)["xf"].full()

    def jacobian(self, x, u):
        result = self.call(1, x0=x, u=u)
        return np.hstack([result["jac_xf_x0"].full(), result["jac_xf_u"].full()])

    def adjoint(self, x, u, seed):
        result = self.call(2, x0=x, u=u, adj_xf=seed)
        return np.vstack([result["adj_x0"].full(), result["adj_u"].full()])

    def hessian(self, x, u, seed):
        """The Hessian, and the Jacobian."""
        result = self.call(3, x0=x, u=u, adj_xf=seed)
        block = lambda *names: np.hstack([result[f"jac_{name}"].full() for name in names])
        h = np.vstack([block("adj_x0_x0", "adj_x0_u"), block("adj_u_x0", "adj_u_u")])
        return h, np.vstack([block("adj_x0_adj_xf"), block("adj_u_adj_xf")]).T


def zeros_of_seed(solver, nx, nu):
    """What follows the seed of the end: nothing in today's acados, `nu` zeros in earlier ones."""
    try:
        solver.set("seed_adj", np.zeros(nx))
    except Exception:  # noqa: BLE001: acados raises no class of its own
        solver.set("seed_adj", np.zeros(nx + nu))
        return np.zeros(nu)
    return np.zeros(0)


class Acados:
    """acados' implicit integrator by its Python interface; `ACADOS_SOURCE_DIR` says where it is."""

    def __init__(self, name, model, seconds, stages, steps, folder):
        from acados_template import AcadosModel, AcadosSim, AcadosSimSolver

        sim, (x, u, f) = AcadosSim(), model
        sim.model, sim.model.name = AcadosModel(), name
        sim.model.x, sim.model.u, sim.model.xdot = x, u, ca.SX.sym("xd", x.numel())
        sim.model.f_impl_expr, sim.model.f_expl_expr = sim.model.xdot - f, f
        options = sim.solver_options
        options.T, options.integrator_type, options.collocation_type = seconds, "IRK", "GAUSS_LEGENDRE"
        options.num_stages, options.num_steps = stages, steps
        options.newton_iter, options.newton_tol = 100, 1e-8 / steps
        options.sens_forw = options.sens_adj = options.sens_hess = True
        sim.code_gen_options.code_export_directory = os.path.join(folder, name)
        sim.code_gen_options.json_file = os.path.join(folder, name + ".json")
        self.nx, self.nu = x.numel(), u.numel()
        self.solver = AcadosSimSolver(sim, verbose=False)
        self.zeros = zeros_of_seed(self.solver, self.nx, self.nu)

    def solve(self, x, u, seed=None):
        self.solver.set("x", x.ravel())
        self.solver.set("u", u.ravel())
        if seed is not None:
            self.solver.set("seed_adj", np.append(seed.ravel(), self.zeros))
        if self.solver.solve():
            raise RuntimeError("acados' integrator failed")
        return self.solver.get

    def value(self, x, u):
        return self.solve(x, u)("x").reshape(-1, 1)

    def jacobian(self, x, u):
        return self.solve(x, u)("S_forw")

    def adjoint(self, x, u, seed):
        return self.solve(x, u, seed)("S_adj").reshape(-1, 1)

    def hessian(self, x, u, seed):
        get = self.solve(x, u, seed)
        return get("S_hess"), get("S_forw")
