"""The models of the benchmarks as CasADi's SX graphs: what all peers in Python are given."""

import casadi as ca


def pendulum(nx):
    """Explicit: x, u, right-hand side."""
    x, u = ca.SX.sym("x", 4), ca.SX.sym("u", 1)
    M, m, l, g = 1.0, 0.1, 0.8, 9.81
    s, c, w = ca.sin(x[1]), ca.cos(x[1]), x[3]
    d = M + m - m * c * c
    a = (-m * l * s * w * w + m * g * c * s + u) / d
    b = (-m * l * c * s * w * w + u * c + (M + m) * g * s) / (l * d)
    return x, u, ca.vertcat(x[2], w, a, b)


def chain(nx):
    """Explicit: x, u, right-hand side."""
    x, u = ca.SX.sym("x", nx), ca.SX.sym("u", 3)
    free = (nx - 3) // 6
    D, m, L = 1.0, 0.033, 0.033
    p = [x[3 * i : 3 * i + 3] for i in range(free + 1)]
    v = [x[3 * (free + 1 + i) : 3 * (free + 1 + i) + 3] for i in range(free)]
    force = []
    for i in range(free + 1):
        d = p[i] - p[i - 1] if i else p[i]
        force.append(D / m * (1 - L / ca.norm_2(d)) * d)
    a = [force[i + 1] - force[i] - ca.DM([0, 0, 9.81]) for i in range(free)]
    return x, u, ca.vertcat(*v, u, *a)


def awe():
    """Implicit: xdot, x, u, z, residual. An aircraft on a tether; see examples/models/awe.rs."""
    xd, x, u, z = ca.SX.sym("xd", 23), ca.SX.sym("x", 23), ca.SX.sym("u", 4), ca.SX.sym("z", 1)
    g, mk, mt, lt, diameter, cd = 9.81, 36.8, 0.0046 * 434.287, 434.287, 0.002, 1.2
    J = ca.DM([[25, 0, 0.47], [0, 32, 0], [0.47, 0, 56]])
    b, S = 5.5, 3.0
    c = S / b
    q, dq, om, R = x[0:3], x[3:6], x[6:9], ca.reshape(x[9:18], 3, 3)
    delta, kappa = x[18:21], 10 * x[21]
    ddq, dom, dR = xd[3:6], xd[6:9], ca.reshape(xd[9:18], 3, 3)

    wind = lambda h: 10.0 * (ca.sqrt(h * h + 1) / 100.0) ** 0.15
    rho = lambda h: 1.225 * ((288.15 - 0.0065 * h) / 288.15) ** (g / 0.0065 / 287.053 - 1)
    apparent = lambda q, dq: ca.vertcat(wind(q[2]), 0, 0) - dq
    ua = apparent(q, dq)
    V = ca.sqrt(ca.dot(ua, ua))
    body = ca.mtimes(R.T, ua)
    forward = ca.sqrt(body[0] ** 2 + 1e-16)
    alpha, beta = body[2] / forward, body[1] / forward
    flip = ca.DM([-1, 1, -1])
    rates = flip * om / (2 * V) * ca.DM([b, c, b])
    P, Q, Rr = rates[0], rates[1], rates[2]
    da, de, dr = delta[0], delta[1], delta[2]
    poly = lambda *cs: sum(k * alpha**i for i, k in enumerate(cs))
    CX = poly(-0.0293, 0.4784, 2.5549) + poly(-0.6029, 4.4124) * Q + poly(-0.0106, 0.1115) * de
    CY = (poly(-0.1855, -0.0299, 0.0936) * beta + poly(-0.1022, -0.0140, 0.0496) * P + poly(0.1694, 0.1368) * Rr
          + poly(-0.0514, -0.0024, 0.0579) * da + poly(0.10325, 0.0268, -0.1036) * dr)
    CZ = (poly(-0.5526, -5.0676, 5.7736) + poly(-7.5560, 0.1251, 6.1486) * Q
          + poly(-0.315, -0.0013, 0.2923) * de)
    Cl = (poly(-0.0630, -0.0003, 0.0312) * beta + poly(-0.5632, -0.0247, 0.2813) * P + poly(0.1811, 0.6448) * Rr
          + poly(-0.2489, -0.0087, 0.2383) * da + poly(0.00436, -0.0013) * dr)
    Cm = poly(-0.0307, -0.6027) + poly(-11.3022, -0.0026, 5.2885) * Q + poly(-1.0427, -0.0061, 0.9974) * de
    Cn = (poly(0.0577, -0.0849) * beta + poly(-0.0565, -0.9137) * P + poly(-0.0553, 0.0290, 0.0257) * Rr
          + poly(0.01903, -0.1147) * da + poly(-0.0404, -0.0117, 0.04089) * dr)
    pressure = 0.5 * rho(q[2]) * V * V * S
    Fa = ca.mtimes(R, flip * ca.vertcat(CX, CY, CZ)) * pressure
    Ma = flip * ca.vertcat(b * Cl, c * Cm, b * Cn) * pressure
    Fg = kappa * V * ua
    power = 0.75 * kappa * V**3

    Ft, t = ca.SX.zeros(3), q / 5
    for k in range(5):
        s = (k + 0.5) / 5
        w = apparent(s * q, s * dq)
        n = ca.sqrt(ca.dot(w, w) + 1e-12)
        across = ca.sqrt(ca.dot(t, t) - (ca.dot(t, w) / n) ** 2 + 1e-12)
        Ft += s * 0.5 * cd * rho(s * q[2]) * n * diameter * across * w

    e = q / lt
    s = ca.dot(e, dq)
    sd = ca.dot(dq, dq) / lt + ca.dot(e, ddq)
    inertia = (mk + mt / 3) * ddq + mt / 3 * e * ((1 + ca.dot(e, e)) * sd + s * s / lt)
    force = inertia + ca.DM([0, 0, mk * g]) + 12.499305032751677 * z * q - Fa - Fg - Ft
    moment = Ma - (ca.mtimes(J, dom) + ca.cross(om, ca.mtimes(J, om)))
    rotation = dR - ca.mtimes(R, (ca.DM.eye(3) - ca.mtimes(R.T, R)) / 2 + ca.skew(om))
    con, dcon = (ca.dot(q, q) - lt * lt) / 2, ca.dot(q, dq)
    ddcon = ca.dot(dq, dq) + ca.dot(q, ddq)
    tf = 13.456375779859805
    wx = [1.25e-11] * 3 + [1.25e-10] * 3 + [6.25e-3] * 3 + [1.25e-10] * 9 + [1.25e-8] * 3 + [1.25e-9, 1.25e-10]
    cost = (-121.96560160548071 * power / 291516.74163444503 / tf + ca.dot(ca.DM([0.25, 0.25, 0.25, 0.025]), u * u)
            + ca.dot(ca.DM(wx), xd * xd) + 0.2 * beta * beta)
    f = ca.vertcat(force / 5178.2085, moment / (mk * g * b / 2), ca.reshape(rotation, 9, 1), xd[18:21] - u[0:3],
                   xd[21] - u[3], xd[0:3] - dq, (ddcon + 0.2 * dcon + 0.01 * con) / 1102500.0, xd[22] - cost)
    return xd, x, u, z, f
