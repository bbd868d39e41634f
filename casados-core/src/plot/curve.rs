//! Curves: points and their appearance in a panel.

use super::svg::Colour;
use alloc::string::String;
use alloc::vec::Vec;

/// A curve or a set of dots. Points that are not finite interrupt a line.
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
    /// The numbers that determine the colour of each point, if any.
    pub(super) values: Vec<f64>,
    pub(super) colour: Option<Colour>,
    /// The width of the line; zero for none.
    pub(super) width: f64,
    pub(super) dashed: bool,
    /// The radius of the dots; zero for none.
    pub(super) radius: f64,
}

impl Curve {
    /// A line through points. The legend shows its name unless it is empty.
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

    /// Steps: each value is held until the next point.
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

    /// A line through `(x, y)` coloured by a third number; a bar beside the panel shows the scale.
    #[must_use]
    pub fn coloured(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64, f64)>) -> Self {
        let (points, values) = points.into_iter().map(|(x, y, value)| ((x, y), value)).unzip();
        Self { points, values, width: 4.0, ..Self::line(name, []) }
    }

    /// Sets the colour; by default the next one of the palette.
    #[must_use]
    pub fn colour(self, colour: Colour) -> Self {
        Self { colour: Some(colour), ..self }
    }

    /// Sets the width of the line in pixels.
    #[must_use]
    pub fn width(self, width: f64) -> Self {
        Self { width, ..self }
    }

    /// Draws the line dashed.
    #[must_use]
    pub fn dashed(self) -> Self {
        Self { dashed: true, ..self }
    }

    /// Adds a dot at each point.
    #[must_use]
    pub fn marked(self) -> Self {
        Self { radius: 3.0, ..self }
    }
}
