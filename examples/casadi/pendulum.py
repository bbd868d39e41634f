"""Swings a pendulum to its upright position: CasADi's Opti and IPOPT over an integrator of casados."""

import casadi

F = casadi.external("pendulum", "target/release/libmodel.so")
N = 60  # intervals of 0.05 s
opti = casadi.Opti()
x, u = opti.variable(4, N + 1), opti.variable(1, N)
opti.minimize(0.01 * casadi.sumsqr(u) + casadi.sumsqr(x))
opti.subject_to(x[:, 1:] == F.map(N)(x[:, :-1], u, casadi.DM(0, N)))
opti.subject_to(x[:, 0] == [0, 3.14159, 0, 0])
opti.subject_to(x[:, -1] == 0)
opti.subject_to(opti.bounded(-20, u, 20))
opti.solver("ipopt")
print(opti.solve().value(u))
