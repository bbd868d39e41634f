//! States and controls of a problem of optimal control over time, with their bounds.

use super::panel::Panel;
use super::series::Series;
use super::svg::Colour;
use crate::ocp::{Dynamics, Formulation, Ocp, OcpError, Text, means};
use crate::qp::{Bounds, SolutionStage, StageDims};
use crate::scalar::Real;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// A variable at a node: its value, its bounds, and their multipliers.
#[derive(Clone, Copy)]
struct Node {
    value: f64,
    bounds: [f64; 2],
    multipliers: [f64; 2],
}

/// A variable over time.
struct Trajectory {
    name: &'static str,
    nodes: Vec<Node>,
    is_control: bool,
}

impl Node {
    fn at<T: Real>(index: usize, values: &[T], bounds: Bounds<'_, T>, multipliers: [&[T]; 2]) -> Self {
        let of = |list: &[T], or: f64| list.get(index).map_or(or, |value| value.to_f64());
        Self {
            value: of(values, f64::NAN),
            bounds: [of(bounds.lower, f64::NEG_INFINITY), of(bounds.upper, f64::INFINITY)],
            multipliers: multipliers.map(|list| of(list, 0.0)),
        }
    }

    /// Whether it is given: its bounds are the same.
    fn is_given(&self) -> bool {
        self.bounds[0] >= self.bounds[1]
    }

    /// Whether a bound holds it: of distance and multiplier, whose product vanishes at a solution,
    /// the multiplier is larger.
    fn is_active(&self) -> bool {
        let sides = self.bounds.into_iter().zip(self.multipliers);
        !self.is_given()
            && sides.into_iter().any(|(bound, multiplier)| multiplier > (self.value - bound).abs())
    }
}

impl Panel {
    /// States or controls at an iterate over time: all that a name means, as in [`Ocp::bound`].
    ///
    /// Controls are stairs. Bounds are dashed, where they are not far from the values; where one is
    /// active the line is wide.
    ///
    /// # Errors
    /// [`OcpError::UnknownName`]
    pub fn trajectories<P, T, D, M>(ocp: &Ocp<P, T, D, M>, name: &str) -> Result<Self, OcpError>
    where
        P: Formulation<T>,
        T: Real,
        D: AsRef<[StageDims]>,
        M: AsRef<[T]> + AsMut<[T]>,
    {
        let known = const { &<P::Dynamics as Dynamics<T>>::NAMES };
        let times: Vec<f64> = ocp.times().iter().map(|time| time.to_f64()).collect();
        let mut all = Vec::new();
        for (is_control, names) in [(false, known.x), (true, known.u)] {
            for (index, &variable) in names.iter().enumerate().filter(|(_, variable)| means(name, variable)) {
                let node = |(stage, data): (SolutionStage<'_, T>, crate::qp::Stage<'_, T>)| match is_control {
                    false => Node::at(index, stage.x, data.x_bounds(), [stage.x_lower, stage.x_upper]),
                    true => Node::at(index, stage.u, data.u_bounds(), [stage.u_lower, stage.u_upper]),
                };
                let mut nodes: Vec<Node> = ocp.iterate().stages().zip(ocp.qp().stages()).map(node).collect();
                if is_control {
                    // The last node has no controls: the one before is held until there.
                    nodes.pop();
                    nodes.extend(nodes.last().copied());
                }
                all.push(Trajectory { name: variable, nodes, is_control });
            }
        }
        if all.is_empty() {
            return Err(OcpError::UnknownName { name: Text::new(name), known });
        }
        let panel = Self::new(format!("{}: {name}", known.model)).x("time");
        Ok(all.iter().enumerate().fold(panel, |panel, (i, trajectory)| {
            trajectory.series(&times, Colour::of(i)).into_iter().fold(panel, Self::with)
        }))
    }
}

impl Trajectory {
    fn series(&self, times: &[f64], colour: Colour) -> Vec<Series> {
        let over = |name: String, value: &dyn Fn(&Node) -> f64| {
            let points = times.iter().zip(&self.nodes).map(|(&t, node)| (t, value(node)));
            let series =
                if self.is_control { Series::steps(name, points) } else { Series::line(name, points) };
            series.colour(colour)
        };
        let (low, high) = super::draw::span(self.nodes.iter().map(|node| &node.value));
        let span = high - low;
        let is_near = |bound: f64| span <= 0.0 || (bound > low - 1.5 * span && bound < high + 1.5 * span);
        let bound = |node: &Node, side: usize| {
            if node.is_given() || !is_near(node.bounds[side]) { f64::NAN } else { node.bounds[side] }
        };
        let active = |node: &Node| if node.is_active() { node.value } else { f64::NAN };
        let mut drawn: Vec<Series> = (0..2)
            .filter(|&side| self.nodes.iter().any(|node| bound(node, side).is_finite()))
            .map(|side| over(String::new(), &|node| bound(node, side)).width(1.0).dashed())
            .collect();
        if self.nodes.iter().any(Node::is_active) {
            let wide = over(String::new(), &active).width(6.0);
            drawn.push(if self.is_control { wide } else { wide.marked() });
        }
        drawn.push(over(self.name.into(), &|node| node.value));
        drawn
    }
}
