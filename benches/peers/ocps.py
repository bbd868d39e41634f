"""The twenty problems of examples/models/ocps for CasADi, written independently: multiple shooting
with the classical Runge-Kutta method, of the differential-algebraic model with Gauss' method."""

from types import SimpleNamespace

import casadi as ca
import numpy as np

inf = np.inf
# Intervals and lengths of horizons, as parts of those that problems are given with.
GRID = {"intervals": 1.0, "length": 1.0}


def grid(given):
    return int(np.floor(GRID["intervals"] * given + 0.5))


def over(length, n):
    return GRID["length"] * length / n


def rk4(f, nx, nu, h, steps):
    x, u = ca.SX.sym("x", nx), ca.SX.sym("u", nu)
    slope = ca.Function("f", [x, u], [f(x, u)])
    end, h = x, h / steps
    for _ in range(steps):
        k1 = slope(end, u)
        k2 = slope(end + h / 2 * k1, u)
        k3 = slope(end + h / 2 * k2, u)
        k4 = slope(end + h * k3, u)
        end = end + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("phi", [x, u], [end])


def gauss(f, nx, nz, nu, h):
    """A step of Gauss' method of two stages for f(x', x, z, u) = 0."""
    root = np.sqrt(3) / 6
    a = [[0.25, 0.25 - root], [0.25 + root, 0.25]]
    x, u, w = ca.MX.sym("x", nx), ca.MX.sym("u", nu), ca.MX.sym("w", 2 * (nx + nz))
    k = [w[:nx], w[nx + nz : 2 * nx + nz]]
    z = [w[nx : nx + nz], w[2 * nx + nz :]]
    stage = lambda i: f(k[i], x + h * (a[i][0] * k[0] + a[i][1] * k[1]), z[i], u)
    problem = {"x": w, "p": ca.vertcat(x, u), "g": ca.vertcat(stage(0), stage(1))}
    newton = ca.rootfinder("newton", "newton", problem, {"abstol": 1e-13})
    w = newton(ca.DM.zeros(2 * (nx + nz)), ca.vertcat(x, u))
    return ca.Function("phi", [x, u], [x + h / 2 * (w[:nx] + w[nx + nz : 2 * nx + nz])])


def line(a, b, n):
    return np.linspace(a, b, n + 1)


def ocp(phi, n, h, x, u, running=None, end=None, path=None, soft=None, x_bounds={}, u_bounds={}, start={}, final={}):
    """Bounds are those of components; `path` is not negative, or between limits in a tuple; `soft` is
    the linear penalty of its violations."""
    nx, nu = phi.size1_in(0), phi.size1_in(1)
    o = SimpleNamespace(phi=phi, n=n, nx=nx, nu=nu, soft=soft)
    sx, su = ca.MX.sym("x", nx), ca.MX.sym("u", nu)
    o.cost = ca.Function("l", [sx, su], [h * running(sx, su) if running else ca.MX(0)])
    o.end = ca.Function("e", [sx], [end(sx) if end else ca.MX(0)])
    g, lower, upper = path if isinstance(path, tuple) else (path, 0.0, inf)
    o.path = ca.Function("g", [sx, su], [g(sx, su) if g else ca.MX(0, 1)])
    o.g_lower, o.g_upper = lower, upper
    o.x_lower, o.x_upper = np.full((n + 1, nx), -inf), np.full((n + 1, nx), inf)
    o.u_lower, o.u_upper = np.full((n, nu), -inf), np.full((n, nu), inf)
    for i, (below, above) in x_bounds.items():
        o.x_lower[:, i], o.x_upper[:, i] = below, above
    for i, (below, above) in u_bounds.items():
        o.u_lower[:, i], o.u_upper[:, i] = below, above
    for stage, values in ((0, start), (n, final)):
        for i, value in values.items():
            below, above = value if isinstance(value, tuple) else (value, value)
            o.x_lower[stage, i], o.x_upper[stage, i] = below, above
    o.x = np.array(x, float) if np.ndim(x) == 2 else np.tile(np.array(x, float), (n + 1, 1))
    o.u = np.tile(np.array(u, float), (n, 1))
    return o


def given(values):
    return dict(enumerate(values))


def car(most=50.0):
    def f(x, u):
        _, _, heading, speed, steering, acceleration, time = ca.vertsplit(x)
        motion = [speed * ca.cos(heading), speed * ca.sin(heading), speed / 2.7 * ca.tan(steering)]
        return time * ca.vertcat(*motion, acceleration, u, 0)

    n, time = grid(40), min(10.0, most)
    x = line([0, 0, 0, 5, 0, 0, time], [50, 20, 0, 5, 0, 0, time], n)
    return ocp(
        rk4(f, 7, 2, over(1, n), 1), n, over(1, n), x, [0, 0], lambda x, u: 1e-3 * ca.sumsqr(u), lambda x: x[6],
        x_bounds={3: (-1, 20), 4: (-0.6, 0.6), 5: (-5, 3), 6: (0.1, most)}, u_bounds={0: (-1, 1), 1: (-10, 10)},
        start=given([0] * 6), final=given([50, 20, 0, 0, 0, 0]),
    )


def tyres():
    mass, inertia, front, rear = 1500.0, 2500.0, 1.2, 1.4
    force = lambda slip: mass * 9.81 / 2 * ca.sin(1.4 * ca.atan(10 * slip))

    def f(x, u):
        _, _, heading, vx, vy, rate, steering = ca.vertsplit(x)
        ff = force(steering - ca.atan((vy + front * rate) / vx))
        fr = force(-ca.atan((vy - rear * rate) / vx))
        return ca.vertcat(
            vx * ca.cos(heading) - vy * ca.sin(heading),
            vx * ca.sin(heading) + vy * ca.cos(heading),
            rate,
            u[1] - ff * ca.sin(steering) / mass + vy * rate,
            (ff * ca.cos(steering) + fr) / mass - vx * rate,
            (front * ff * ca.cos(steering) - rear * fr) / inertia,
            u[0],
        )

    n = grid(40)
    x = line([0, 0, 0, 20, 0, 0, 0], [80, 0, 0, 20, 0, 0, 0], n)
    o = ocp(
        rk4(f, 7, 2, over(4, n), 2), n, over(4, n), x, [0, 0], lambda x, u: u[0] ** 2 + 0.01 * u[1] ** 2 + 0.1 * x[5] ** 2,
        x_bounds={1: (-4, 4), 2: (-1.5, 1.5), 3: (3, 40), 6: (-0.5, 0.5)}, u_bounds={0: (-1, 1), 1: (-8, 4)},
        start=given([0, 0, 0, 20, 0, 0, 0]), final={0: (70, inf), 1: 0, 2: 0},
    )
    o.x_lower[3 * n // 8 : 11 * n // 20, 1] = 2.5
    o.x_lower[7 * n // 10 : n, 1], o.x_upper[7 * n // 10 : n, 1] = -0.5, 0.5
    return o


def unicycle(x, u):
    return ca.vertcat(x[3] * ca.cos(x[2]), x[3] * ca.sin(x[2]), u)


def obstacles():
    n = grid(40)
    discs = [(3.0, 0.3, 1.0), (6.0, -0.5, 1.2), (8.0, 1.0, 0.8)]
    outside = lambda x, u: ca.vertcat(*[(x[0] - a) ** 2 + (x[1] - b) ** 2 - r**2 for a, b, r in discs])
    return ocp(
        rk4(unicycle, 4, 2, over(10, n), 1), n, over(10, n), line([0, 0, 0, 1], [10, 0, 0, 1], n), [0, 0],
        lambda x, u: ca.sumsqr(u) / 2, path=outside, u_bounds={0: (-2, 2), 1: (-1, 1)},
        start=given([0, 0, 0, 1]), final=given([10, 0, 0, 1]),
    )


def walls():
    n = grid(40)
    o = ocp(
        rk4(unicycle, 4, 2, over(10, n), 1), n, over(10, n), line([0, 0, 0, 1], [10, 0, 0, 1], n), [0, 0],
        lambda x, u: ca.sumsqr(u) / 2, x_bounds={3: (0, 2)}, u_bounds={0: (-2, 2), 1: (-1, 1)},
        start=given([0, 0, 0, 1]), final={0: 10, 1: 0},
    )
    o.x_lower[20, 1], o.x_upper[20, 1], o.x_lower[23, 1], o.x_upper[23, 1] = 1.5, 100, -100, -1.5
    return o


def quadrotor():
    hover, inertia = 9.81 / 4, ca.DM([0.01, 0.01, 0.02])

    def f(x, u):
        q, v, rates, time = x[3:7], x[7:10], x[10:13], x[13]
        axis = ca.vertcat(2 * (q[1] * q[3] + q[0] * q[2]), 2 * (q[2] * q[3] - q[0] * q[1]),
                          q[0] ** 2 - q[1] ** 2 - q[2] ** 2 + q[3] ** 2)
        turn = 0.5 * ca.vertcat(-ca.dot(q[1:], rates), q[0] * rates + ca.cross(q[1:], rates))
        torque = ca.vertcat(0.2 * (u[1] - u[3]), 0.2 * (u[2] - u[0]), 0.02 * (u[0] - u[1] + u[2] - u[3]))
        spin = (torque - ca.cross(rates, inertia * rates)) / inertia
        return time * ca.vertcat(v, turn, axis * ca.sum1(u) - ca.vertcat(0, 0, 9.81), spin, 0)

    n = grid(30)
    rest = [0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    x = line([0, 0, 1, 1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 3], [6, 0, 1, 1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 3], n)
    end = given([6] + rest)
    del end[3]
    outside = lambda x, u: ca.vertcat((x[0] - 2) ** 2 + (x[1] - 0.2) ** 2 - 0.64, (x[0] - 4) ** 2 + (x[1] + 0.3) ** 2 - 0.64)
    return ocp(
        rk4(f, 14, 4, over(1, n), 1), n, over(1, n), x, [hover] * 4,
        lambda x, u: 1e-2 * (ca.sumsqr(u - hover) + ca.sumsqr(x[10:13])), lambda x: x[13], path=outside, soft=100.0,
        x_bounds={1: (-1.5, 1.5), 13: (0.3, 20)}, u_bounds=given([(0, 6)] * 4), start=given([0] + rest), final=end,
    )


def landing():
    def f(x, u):
        a = x[2] + u[1]
        thrust = ca.vertcat(-ca.sin(a), ca.cos(a)) * u[0] / x[6] - ca.vertcat(0, 9.81)
        return x[7] * ca.vertcat(x[3:6], thrust, -u[0] * ca.sin(u[1]) * 2 / (3 * x[6]), -u[0] / 300, 0)

    n, start = grid(40), [20, 100, 0.3, -5, -15, 0, 10]
    return ocp(
        rk4(f, 8, 2, over(1, n), 1), n, over(1, n), line(start + [8], [0, 0, 0, 0, 0, 0, 9, 8], n), [100, 0], end=lambda x: -x[6],
        x_bounds={1: (0, inf), 2: (-1, 1), 5: (-1, 1), 6: (1, 10), 7: (1, 30)}, u_bounds={0: (30, 200), 1: (-0.2, 0.2)},
        start=given(start), final=given([0] * 6),
    )


def goddard():
    def f(x, u):
        h, v, mass, time = ca.vertsplit(x)
        drag = 310 * v**2 * ca.exp(-500 * (h - 1))
        return time * ca.vertcat(v, (u - drag) / mass - 1 / h**2, -2 * u, 0)

    n = grid(50)
    return ocp(
        rk4(f, 4, 1, over(1, n), 1), n, over(1, n), line([1, 0, 1, 0.2], [1.01, 0, 0.6, 0.2], n), [1.75], end=lambda x: -x[0],
        x_bounds={0: (1, inf), 1: (0, inf), 2: (0.6, 1), 3: (0.01, 1)}, u_bounds={0: (0, 3.5)},
        start=given([1, 0, 1]), final={2: 0.6},
    )


def cart_pole():
    M, m, length, g = 1.0, 0.1, 0.8, 9.81

    def f(x, u):
        s, c, rate = ca.sin(x[1]), ca.cos(x[1]), x[3]
        d = M + m - m * c**2
        cart = (-m * length * s * rate**2 + m * g * c * s + u) / d
        pole = (-m * length * c * s * rate**2 + u * c + (M + m) * g * s) / (length * d)
        return ca.vertcat(x[2], rate, cart, pole)

    n = grid(40)
    return ocp(
        rk4(f, 4, 1, over(2, n), 2), n, over(2, n), line([0, np.pi, 0, 0], [0] * 4, n), [0],
        lambda x, u: 5e-3 * (ca.sumsqr(x) + u**2), x_bounds={0: (-2, 2)}, u_bounds={0: (-20, 20)},
        start=given([0, np.pi, 0, 0]), final=given([0] * 4),
    )


def crane():
    def f(x, u):
        _, v, angle, rate, length, growth, time = ca.vertsplit(x)
        swing = -(u[0] * ca.cos(angle) + 9.81 * ca.sin(angle) + 2 * growth * rate) / length
        return time * ca.vertcat(v, u[0], rate, swing, growth, u[1], 0)

    n, start, end = grid(40), [0, 0, 0, 0, 5, 0], [10, 0, 0, 0, 3, 0]
    return ocp(
        rk4(f, 7, 2, over(1, n), 1), n, over(1, n), line(start + [6], end + [6], n), [0, 0], lambda x, u: 1e-3 * ca.sumsqr(u),
        lambda x: x[6], x_bounds={1: (-4, 4), 2: (-0.5, 0.5), 4: (1, 10), 5: (-2, 2), 6: (0.5, 30)},
        u_bounds={0: (-2, 2), 1: (-1, 1)}, start=given(start), final=given(end),
    )


def arm():
    def f(x, u):
        c, s = ca.cos(x[1]), ca.sin(x[1])
        inertia = ca.vertcat(ca.horzcat(5 / 3 + c, 1 / 3 + c / 2), ca.horzcat(1 / 3 + c / 2, 1 / 3))
        torque = u + s / 2 * ca.vertcat(2 * x[2] * x[3] + x[3] ** 2, -x[2] ** 2)
        return x[4] * ca.vertcat(x[2:4], ca.solve(inertia, torque), 0)

    n = grid(40)
    return ocp(
        rk4(f, 5, 2, over(1, n), 1), n, over(1, n), line([0, 0, 0, 0, 2], [2, 1.5, 0, 0, 2], n), [0, 0], end=lambda x: x[4],
        x_bounds={4: (0.1, 20)}, u_bounds={0: (-5, 5), 1: (-3, 3)}, start=given([0] * 4), final=given([2, 1.5, 0, 0]),
    )


def pendulum():
    n = grid(50)
    return ocp(
        rk4(lambda x, u: ca.vertcat(x[1], u - 9.81 * ca.sin(x[0])), 2, 1, over(4, n), 2), n, over(4, n),
        line([0, 0], [np.pi, 0], n), [0], lambda x, u: u**2 / 2, u_bounds={0: (-3, 3)},
        start=given([0, 0]), final=given([np.pi, 0]),
    )


def robot():
    def f(x, u):
        force = u[0] - u[1] + u[2] - u[3]
        return ca.vertcat(x[3:6], force * ca.cos(x[2]), force * ca.sin(x[2]), 0.2 * (u[0] - u[1] - u[2] + u[3]))

    n, start = grid(40), [-10, -10, np.pi / 2, 0, 0, 0]
    return ocp(
        rk4(f, 6, 4, over(12, n), 1), n, over(12, n), line(start, [0] * 6, n), [0] * 4, lambda x, u: ca.sum1(u),
        u_bounds=given([(0, 1)] * 4), start=given(start), final=given([0] * 6),
    )


def motor():
    def f(k, x, z, u):
        return ca.vertcat(k[0] - x[1], k[1] + ca.sin(x[0]) + 0.1 * x[1] - z, z + 0.2 * z**3 + 0.5 * x[1] - u)

    n = grid(30)
    return ocp(
        gauss(f, 2, 1, 1, over(3, n)), n, over(3, n), line([0, 0], [np.pi, 0], n), [0], lambda x, u: u**2,
        x_bounds={1: (-2, 2)}, u_bounds={0: (-4, 4)}, start=given([0, 0]), final=given([np.pi, 0]),
    )


def bang_bang():
    n = grid(30)
    return ocp(
        rk4(lambda x, u: x[2] * ca.vertcat(x[1], u, 0), 3, 1, over(1, n), 1), n, over(1, n), [2, 1, 5], [0], end=lambda x: x[2],
        x_bounds={2: (0.1, 20)}, u_bounds={0: (-1, 1)}, start=given([0, 0]), final=given([4, 0]),
    )


def van_der_pol():
    n = grid(40)
    return ocp(
        rk4(lambda x, u: ca.vertcat((1 - x[1] ** 2) * x[0] - x[1] + u, x[0]), 2, 1, over(10, n), 1), n, over(10, n), [0, 0], [0],
        lambda x, u: ca.sumsqr(x) + u**2, x_bounds={0: (-0.25, inf)}, u_bounds={0: (-1, 1)}, start=given([0, 1]),
    )


def bryson_denham():
    n = grid(50)
    return ocp(
        rk4(lambda x, u: ca.vertcat(x[1], u), 2, 1, over(1, n), 1), n, over(1, n), line([0, 1], [0, -1], n), [0],
        lambda x, u: u**2 / 2, x_bounds={0: (-inf, 1 / 9)}, start=given([0, 1]), final=given([0, -1]),
    )


def rayleigh():
    f = lambda x, u: ca.vertcat(x[1], -x[0] + x[1] * (1.4 - 0.14 * x[1] ** 2) + 4 * u)
    n = grid(45)
    return ocp(
        rk4(f, 2, 1, over(4.5, n), 1), n, over(4.5, n), [-5, -5], [0], lambda x, u: u**2 + x[0] ** 2,
        path=(lambda x, u: u + x[0] / 6, -1.0, 0.0), start=given([-5, -5]),
    )


def zermelo():
    def f(x, u):
        return x[2] * ca.vertcat(ca.cos(u) + 0.5 * ca.sin(np.pi * x[1]), ca.sin(u) - 0.3 * x[0], 0)

    n = grid(40)
    return ocp(
        rk4(f, 3, 1, over(1, n), 1), n, over(1, n), line([0, 0, 3], [3, 1, 3], n), [0], end=lambda x: x[2],
        x_bounds={2: (0.1, 20)}, start=given([0, 0]), final=given([3, 1]),
    )


def hanging_chain():
    n = grid(50)
    return ocp(
        rk4(lambda x, u: ca.vertcat(u, x[0] * ca.sqrt(1 + u**2), ca.sqrt(1 + u**2)), 3, 1, over(1, n), 1), n, over(1, n),
        line([1, 0, 0], [3, 6, 4], n), [2], end=lambda x: x[1], start=given([1, 0, 0]), final={0: 3, 2: 4},
    )


def batch_reactor():
    def f(x, u):
        first, second = 4000 * ca.exp(-2500 / u) * x[0] ** 2, 620000 * ca.exp(-5000 / u) * x[1]
        return ca.vertcat(-first, first - second)

    n = grid(40)
    return ocp(
        rk4(f, 2, 1, over(1, n), 1), n, over(1, n), [1, 0], [350], end=lambda x: -x[1], u_bounds={0: (298, 398)}, start=given([1, 0])
    )


def fishing():
    def f(x, u):
        eaten = x[0] * x[1]
        return ca.vertcat(x[0] - eaten - 0.4 * x[0] * u, -x[1] + eaten - 0.2 * x[1] * u)

    n = grid(60)
    return ocp(
        rk4(f, 2, 1, over(12, n), 1), n, over(12, n), [0.5, 0.7], [0.5], lambda x, u: ca.sumsqr(x - 1), u_bounds={0: (0, 1)},
        start=given([0.5, 0.7]),
    )


ALL = [
    car, tyres, obstacles, quadrotor, landing, goddard, cart_pole, crane, arm, pendulum, robot, motor, bang_bang,
    van_der_pol, bryson_denham, rayleigh, zermelo, hanging_chain, batch_reactor, fishing,
]


def car_without_time():
    return car(1.0)


INFEASIBLE = [car_without_time, walls]
