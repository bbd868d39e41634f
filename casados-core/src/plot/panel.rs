//! A panel: two axes and its curves.

use super::axis::Axis;
use super::curve::Curve;
use super::svg::Colour;
use alloc::string::String;
use alloc::vec::Vec;
use core::ops::Range;

/// Two axes with curves.
///
/// Ranges follow from the data unless they are given.
///
/// ```
/// use casados::plot::{Figure, Panel};
///
/// let errors = [(1.0, 1e-2), (2.0, 6e-4), (4.0, 4e-5)];
/// let panel = Panel::new("Convergence").x("steps").y("error").log_x().log_y().dots("Rk4", errors);
/// assert!(Figure::new().with(panel).to_svg().starts_with("<svg"));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Panel {
    pub(super) title: String,
    pub(super) x: Axis,
    pub(super) y: Axis,
    pub(super) is_equal: bool,
    pub(super) series: Vec<Curve>,
    /// Horizontal limit lines.
    pub(super) limits: Vec<f64>,
    pub(super) texts: Vec<((f64, f64), String)>,
    /// A direction field.
    pub(super) field: Option<fn([f64; 2]) -> [f64; 2]>,
}

impl Panel {
    /// An empty panel with a title.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// Sets the title.
    #[must_use]
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Sets the label of the horizontal axis.
    #[must_use]
    pub fn x(mut self, label: impl Into<String>) -> Self {
        self.x.label = label.into();
        self
    }

    /// Sets the label of the vertical axis.
    #[must_use]
    pub fn y(mut self, label: impl Into<String>) -> Self {
        self.y.label = label.into();
        self
    }

    /// Sets the range of the horizontal axis; curves are clipped to it.
    #[must_use]
    pub fn x_range(mut self, range: Range<f64>) -> Self {
        self.x.given = Some((range.start, range.end));
        self
    }

    /// Sets the range of the vertical axis; curves are clipped to it.
    #[must_use]
    pub fn y_range(mut self, range: Range<f64>) -> Self {
        self.y.given = Some((range.start, range.end));
        self
    }

    /// Replaces the numbers below the horizontal axis by names: the first one at zero, the second
    /// at one.
    #[must_use]
    pub fn x_names<N: Into<String>>(mut self, names: impl IntoIterator<Item = N>) -> Self {
        self.x.names = names.into_iter().map(Into::into).collect();
        self.x.given = Some((-0.5, self.x.names.len() as f64 - 0.5));
        self
    }

    /// Makes the horizontal axis logarithmic. Numbers that are not positive are omitted.
    #[must_use]
    pub fn log_x(mut self) -> Self {
        self.x.is_log = true;
        self
    }

    /// Makes the vertical axis logarithmic. Numbers that are not positive are omitted.
    #[must_use]
    pub fn log_y(mut self) -> Self {
        self.y.is_log = true;
        self
    }

    /// Gives both axes the same scale, so that circles are round.
    #[must_use]
    pub fn equal(mut self) -> Self {
        self.is_equal = true;
        self
    }

    /// Adds a curve; later curves are drawn over it.
    #[must_use]
    pub fn with(mut self, curve: Curve) -> Self {
        self.series.push(curve);
        self
    }

    /// [`Curve::line`]
    #[must_use]
    pub fn line(self, name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.with(Curve::line(name, points))
    }

    /// [`Curve::steps`]
    #[must_use]
    pub fn steps(self, name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.with(Curve::steps(name, points))
    }

    /// [`Curve::dots`]
    #[must_use]
    pub fn dots(self, name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.with(Curve::dots(name, points))
    }

    /// [`Curve::coloured`]
    #[must_use]
    pub fn coloured(
        self,
        name: impl Into<String>,
        points: impl IntoIterator<Item = (f64, f64, f64)>,
    ) -> Self {
        self.with(Curve::coloured(name, points))
    }

    /// Adds the outline of an object in the colour of ink: wings, a wall, an obstacle.
    #[must_use]
    pub fn outline(self, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.with(Curve::line("", points).colour(Colour::INK))
    }

    /// Adds a moving object: its shapes at successive times, from light to dark.
    #[must_use]
    pub fn motion<S: IntoIterator<Item = (f64, f64)>>(mut self, shapes: impl IntoIterator<Item = S>) -> Self {
        let shapes: Vec<S> = shapes.into_iter().collect();
        let last = shapes.len().saturating_sub(1).max(1) as f64;
        for (i, shape) in shapes.into_iter().enumerate() {
            let series = Curve::line("", shape).colour(Colour::shade(i as f64 / last)).width(1.0).marked();
            self.series.push(Curve { radius: 2.0, ..series });
        }
        self
    }

    /// Adds a horizontal limit: a red dashed line.
    #[must_use]
    pub fn limit(mut self, value: f64) -> Self {
        self.limits.push(value);
        self
    }

    /// Adds a text at a point.
    #[must_use]
    pub fn text(mut self, at: (f64, f64), words: impl Into<String>) -> Self {
        self.texts.push((at, words.into()));
        self
    }

    /// Adds a direction field, such as the right-hand side of a model with two states, as short
    /// strokes in the background: with solutions as lines, a phase portrait.
    #[must_use]
    pub fn field(mut self, field: fn([f64; 2]) -> [f64; 2]) -> Self {
        self.field = Some(field);
        self
    }
}
