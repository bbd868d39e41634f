"""Brings a pendulum upright: CasADi's Opti and IPOPT over an integrator of casados."""

import casadi

F = casadi.external("pendulum", "target/release/libmodel.so")
N = 40  # intervals of 0.05 s
opti = casadi.Opti()
x, u = opti.variable(4, N + 1), opti.variable(1, N)
opti.minimize(casadi.sumsqr(x) + 0.01 * casadi.sumsqr(u))
opti.subject_to(x[:, 1:] == F.map(N)(x[:, :-1], u, casadi.DM(0, N)))
opti.subject_to(x[:, 0] == [0, 0.6, 0, 0])
opti.subject_to(x[:, -1] == 0)
opti.subject_to(opti.bounded(-20, u, 20))
opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
print(opti.solve().value(u))
