//! What is drawn in a panel: points, and how they look.

use super::svg::Colour;
use alloc::string::String;
use alloc::vec::Vec;

/// Points that belong together. What is not finite interrupts a line.
///
/// ```
/// use casados::plot::{Curve, Panel};
///
/// let dashed = Curve::line("reference", [(0.0, 1.0), (5.0, 1.0)]).dashed();
/// let _panel = Panel::new("Position").with(dashed);
/// ```
#[derive(Clone, Debug)]
pub struct Curve {
    pub(super) name: String,
    pub(super) points: Vec<(f64, f64)>,
    /// What decides about colours, one for each point, or nothing.
    pub(super) values: Vec<f64>,
    pub(super) colour: Option<Colour>,
    /// Of the line; zero if there is none.
    pub(super) width: f64,
    pub(super) dashed: bool,
    /// Of dots; zero if there are none.
    pub(super) radius: f64,
}

impl Curve {
    /// A line through points. A name stands in the legend; an empty one does not.
    #[must_use]
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self {
            name: name.into(),
            points: points.into_iter().collect(),
            values: Vec::new(),
            colour: None,
            width: 2.0,
            dashed: false,
            radius: 0.0,
        }
    }

    /// Stairs: each value is held until the next point.
    #[must_use]
    pub fn steps(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut curve = Self::line(name, []);
        for (x, y) in points {
            if let Some(&(_, held)) = curve.points.last() {
                curve.points.push((x, held));
            }
            curve.points.push((x, y));
        }
        curve
    }

    /// Dots.
    #[must_use]
    pub fn dots(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { width: 0.0, ..Self::line(name, points).marked() }
    }

    /// A line through `(x, y)` whose colour is a third number; a bar beside the panel says which.
    #[must_use]
    pub fn coloured(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64, f64)>) -> Self {
        let (points, values) = points.into_iter().map(|(x, y, value)| ((x, y), value)).unzip();
        Self { points, values, width: 4.0, ..Self::line(name, []) }
    }

    /// Another colour than the next one of the palette.
    #[must_use]
    pub fn colour(self, colour: Colour) -> Self {
        Self { colour: Some(colour), ..self }
    }

    /// The width of the line in pixels.
    #[must_use]
    pub fn width(self, width: f64) -> Self {
        Self { width, ..self }
    }

    /// With dashes.
    #[must_use]
    pub fn dashed(self) -> Self {
        Self { dashed: true, ..self }
    }

    /// With a dot at each point.
    #[must_use]
    pub fn marked(self) -> Self {
        Self { radius: 3.0, ..self }
    }
}
