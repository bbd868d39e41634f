//! Plants whose algebraic equations are written down, as the books have them, and the same with
//! their algebraic states eliminated by hand.

use casados::dae;

/// Each plant in both forms, and what they share.
#[dae]
pub mod equations {
    /// The tridiagonal system of twenty pressures: pipe `e` leads from node `e − 1` to node `e`,
    /// nodes are joined by bypasses of conductance `BYPASS`, and each leaks. `flow` has 21 pipes.
    const LEAK: f64 = 0.4;
    const BYPASS: f64 = 2.0;
    const RESISTANCE: f64 = 0.8;
    const INERTIA: f64 = 0.05;

    /// The pressure of the supply: a pump that pulsates.
    fn supply(t: f64) -> f64 {
        8.0 + 2.0 * (1.5 * t).sin()
    }

    /// A hydraulic network. x = flows of 21 pipes, z = pressures of the 20 nodes between them.
    #[dae]
    pub fn pipes(xdot: [f64; 21], x: [f64; 21], z: [f64; 20], t: f64) -> [f64; 41] {
        let mut residual = [0.0; 41];
        for e in 0..21 {
            let from = if e == 0 { supply(t) } else { z[e - 1] };
            let to = if e == 20 { 0.0 } else { z[e] };
            residual[e] = INERTIA * xdot[e] - (from - to - RESISTANCE * x[e] * (1.0 + x[e] * x[e]));
        }
        for i in 0..20 {
            let before = if i == 0 { z[0] } else { z[i - 1] };
            let after = if i == 19 { z[19] } else { z[i + 1] };
            let leak = LEAK * (1.0 + 0.1 * i as f64) * z[i];
            residual[21 + i] = x[i] - x[i + 1] - leak - BYPASS * (2.0 * z[i] - before - after);
        }
        residual
    }

    /// The same with the pressures found by elimination.
    #[ode]
    pub fn pipes_eliminated(x: [f64; 21], t: f64) -> [f64; 21] {
        let (mut pivot, mut pressure) = ([0.0; 20], [0.0; 20]);
        for i in 0..20 {
            let neighbours = if i == 0 || i == 19 { 1.0 } else { 2.0 };
            pivot[i] = LEAK * (1.0 + 0.1 * i as f64) + BYPASS * neighbours;
            pressure[i] = x[i] - x[i + 1];
            if i > 0 {
                let factor = BYPASS / pivot[i - 1];
                pivot[i] -= factor * BYPASS;
                pressure[i] += factor * pressure[i - 1];
            }
        }
        for step in 0..20 {
            let i = 19 - step;
            if i < 19 {
                pressure[i] += BYPASS * pressure[i + 1];
            }
            pressure[i] /= pivot[i];
        }
        let mut slope = [0.0; 21];
        for e in 0..21 {
            let from = if e == 0 { supply(t) } else { pressure[e - 1] };
            let to = if e == 20 { 0.0 } else { pressure[e] };
            slope[e] = (from - to - RESISTANCE * x[e] * (1.0 + x[e] * x[e])) / INERTIA;
        }
        slope
    }

    /// The rate of a reaction at a temperature in units of 300 K.
    fn arrhenius(temperature: f64) -> f64 {
        (18.0 - 20.0 / temperature).exp()
    }

    /// Six stirred tanks in a row in which a reaction heats. x = [concentrations, temperatures], z
    /// = rates.
    #[dae]
    pub fn tanks(xdot: [f64; 12], x: [f64; 12], z: [f64; 6]) -> [f64; 18] {
        let mut residual = [0.0; 18];
        for i in 0..6 {
            let (c, temperature) = if i == 0 { (1.0, 1.0) } else { (x[i - 1], x[5 + i]) };
            residual[i] = xdot[i] - (c - x[i]) + z[i];
            residual[6 + i] = xdot[6 + i] - (temperature - x[6 + i]) - 0.25 * z[i] + 0.4 * (x[6 + i] - 1.0);
            residual[12 + i] = z[i] - arrhenius(x[6 + i]) * x[i];
        }
        residual
    }

    /// The same with the rates in their places.
    #[ode]
    pub fn tanks_eliminated(x: [f64; 12]) -> [f64; 12] {
        let mut slope = [0.0; 12];
        for i in 0..6 {
            let (c, temperature) = if i == 0 { (1.0, 1.0) } else { (x[i - 1], x[5 + i]) };
            let rate = arrhenius(x[6 + i]) * x[i];
            slope[i] = c - x[i] - rate;
            slope[6 + i] = temperature - x[6 + i] + 0.25 * rate - 0.4 * (x[6 + i] - 1.0);
        }
        slope
    }

    /// Heat passes a wall without mass better where the hot side is hotter.
    fn transfer(hot: f64) -> f64 {
        20.0 * (1.0 + 0.5 * hot)
    }

    /// A heat exchanger in counterflow, eight cells. x = [hot, cold], z = temperatures of the wall.
    #[dae]
    pub fn exchanger(xdot: [f64; 16], x: [f64; 16], z: [f64; 8], t: f64) -> [f64; 24] {
        let mut residual = [0.0; 24];
        for i in 0..8 {
            let (hot, cold) = (x[i], x[8 + i]);
            let before = if i == 0 { 1.0 + 0.2 * (2.0 * t).sin() } else { x[i - 1] };
            let after = if i == 7 { 0.0 } else { x[9 + i] };
            residual[i] = xdot[i] - 8.0 * (before - hot) + transfer(hot) * (hot - z[i]);
            residual[8 + i] = xdot[8 + i] - 5.0 * (after - cold) - 30.0 * (z[i] - cold);
            residual[16 + i] = transfer(hot) * (hot - z[i]) - 30.0 * (z[i] - cold);
        }
        residual
    }

    /// The same without the wall.
    #[ode]
    pub fn exchanger_eliminated(x: [f64; 16], t: f64) -> [f64; 16] {
        let mut slope = [0.0; 16];
        for i in 0..8 {
            let (hot, cold) = (x[i], x[8 + i]);
            let before = if i == 0 { 1.0 + 0.2 * (2.0 * t).sin() } else { x[i - 1] };
            let after = if i == 7 { 0.0 } else { x[9 + i] };
            let wall = (transfer(hot) * hot + 30.0 * cold) / (transfer(hot) + 30.0);
            slope[i] = 8.0 * (before - hot) - transfer(hot) * (hot - wall);
            slope[8 + i] = 5.0 * (after - cold) + 30.0 * (wall - cold);
        }
        slope
    }

    /// The residual of the elastic beam of [`Beam`](crate::models::ivp::vibrations::Beam) with
    /// forty pieces. x = [θ, θ̇], z = [u].
    fn pulled(xdot: [f64; 80], x: [f64; 80], z: [f64; 40], t: f64) -> [f64; 120] {
        let n = 40;
        let (n2, n4) = ((n * n) as f64, (n * n * n * n) as f64);
        let pull = if t <= core::f64::consts::PI { 1.5 * t.sin() * t.sin() } else { 0.0 };
        let angle = |i: usize| x[i];
        let moment = |i: usize| {
            let before = if i == 0 { -angle(0) } else { angle(i - 1) };
            let after = if i + 1 == n { angle(i) } else { angle(i + 1) };
            n4 * (before - 2.0 * angle(i) + after) + n2 * pull * (angle(i).cos() + angle(i).sin())
        };
        let diagonal = |i: usize| {
            if i == 0 {
                1.0
            } else if i + 1 == n {
                3.0
            } else {
                2.0
            }
        };
        // θ̈ = C v + D u, C u = D v + θ̇², with C and D real and imaginary part of one Hermitian
        // matrix of three diagonals.
        let mut residual = [0.0; 120];
        for i in 0..n {
            let mut acceleration = diagonal(i) * moment(i);
            let mut equation = diagonal(i) * z[i] - x[n + i] * x[n + i];
            if i > 0 {
                let (sin, cos) = (angle(i) - angle(i - 1)).sin_cos();
                acceleration = acceleration - cos * moment(i - 1) - sin * z[i - 1];
                equation = equation - cos * z[i - 1] + sin * moment(i - 1);
            }
            if i + 1 < n {
                let (sin, cos) = (angle(i) - angle(i + 1)).sin_cos();
                acceleration = acceleration - cos * moment(i + 1) - sin * z[i + 1];
                equation = equation - cos * z[i + 1] + sin * moment(i + 1);
            }
            residual[i] = xdot[i] - x[n + i];
            residual[n + i] = xdot[n + i] - acceleration;
            residual[2 * n + i] = equation;
        }
        residual
    }

    /// The elastic beam of forty pieces.
    #[dae]
    pub fn long_beam(xdot: [f64; 80], x: [f64; 80], z: [f64; 40], t: f64) -> [f64; 120] {
        pulled(xdot, x, z, t)
    }

    /// The same with ranges: of angles and rates, of forces, and of the time.
    #[dae(range(x = -5.0..=5.0, z = -2e4..=2e4, t = 0.0..=5.0))]
    pub fn long_beam_in_ranges(xdot: [f64; 80], x: [f64; 80], z: [f64; 40], t: f64) -> [f64; 120] {
        pulled(xdot, x, z, t)
    }
}
