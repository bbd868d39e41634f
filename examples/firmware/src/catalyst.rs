//! A model with an algebraic state: a stirred tank with a catalyst, whose reaction uses up what
//! lies before its surface.

use casados::dae;

/// x = [concentrations of what comes in and of what it becomes, temperature], z = [rate of the
/// reaction], u = [flow, cooling], all without dimension. The rate is of second order in the
/// concentration at the surface, which is the lower, the faster the reaction is.
#[dae]
pub fn catalyst(xdot: [f64; 3], x: [f64; 3], z: [f64; 1], u: [f64; 2]) -> [f64; 4] {
    const HEAT: f64 = 0.8;
    const LAYER: f64 = 0.2;

    let [inflow, product, temperature] = x;
    let (rate, [flow, cooling]) = (z[0], u);
    let surface = inflow - LAYER * rate;
    [
        xdot[0] - flow * (1.0 - inflow) + rate,
        xdot[1] + flow * product - rate,
        xdot[2] + (flow + cooling) * temperature - HEAT * rate,
        rate - (temperature / (1.0 + 0.1 * temperature)).exp() * surface * surface,
    ]
}
