//! Figures: panels on a page, as text or file.

use super::draw::Area;
use super::panel::Panel;
use super::space::Space;
use super::sparsity::Sparsity;
use super::svg::Canvas;
use alloc::string::String;
use alloc::vec::Vec;
use std::path::Path;

/// A part of a figure: a [`Panel`], a [`Space`] or a [`Sparsity`].
///
/// ```
/// # use casados::plot::{Cell, Figure, Panel};
/// let line = |k: f64| Panel::new("x").line("x", [(0.0, 0.0), (1.0, k)]);
/// let cells: Vec<Cell> = vec![line(1.0).into(), line(2.0).into()];
/// assert!(Figure::new().with_all(cells).to_svg().starts_with("<svg"));
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Cell {
    /// Two axes.
    Panel(Panel),
    /// Three axes.
    Space(Space),
    /// A matrix.
    Sparsity(Sparsity),
}

impl From<Panel> for Cell {
    fn from(panel: Panel) -> Self {
        Self::Panel(panel)
    }
}

impl From<Space> for Cell {
    fn from(space: Space) -> Self {
        Self::Space(space)
    }
}

impl From<Sparsity> for Cell {
    fn from(sparsity: Sparsity) -> Self {
        Self::Sparsity(sparsity)
    }
}

/// Panels in columns.
///
/// Columns are filled from top to bottom and from left to right; all panels of a column have the
/// same height.
///
/// ```
/// use casados::plot::{Figure, Panel};
///
/// let wave = |t: usize| (0.1 * t as f64, (0.1 * t as f64).sin());
/// let figure = Figure::new()
///     .with(Panel::new("A sine").x("time, s").line("sine", (0..70).map(wave)))
///     .with(Panel::new("Held").steps("sine", (0..70).step_by(10).map(wave)));
/// assert!(figure.to_svg().contains("A sine"));
/// // figure.save("sine.svg")?;
/// ```
#[derive(Clone, Debug, Default)]
pub struct Figure {
    columns: Vec<(f64, Vec<Cell>)>,
    size: Option<(f64, f64)>,
}

/// The default size of a panel.
const SIZE: (f64, f64) = (620.0, 320.0);
const MARGIN: f64 = 8.0;

impl Figure {
    /// An empty figure.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets width and height in pixels. By default each panel has 620 by 320.
    #[must_use]
    pub fn size(mut self, width: u32, height: u32) -> Self {
        self.size = Some((f64::from(width), f64::from(height)));
        self
    }

    /// Starts a new column, `share` times as wide as one of share 1.
    #[must_use]
    pub fn column(mut self, share: f64) -> Self {
        self.columns.push((if share > 0.0 && share.is_finite() { share } else { 1.0 }, Vec::new()));
        self
    }

    /// Adds a panel below the last one.
    #[must_use]
    pub fn with(mut self, cell: impl Into<Cell>) -> Self {
        if self.columns.is_empty() {
            self = self.column(1.0);
        }
        if let Some((_, cells)) = self.columns.last_mut() {
            cells.push(cell.into());
        }
        self
    }

    /// Adds several panels below each other.
    #[must_use]
    pub fn with_all<C: Into<Cell>>(self, cells: impl IntoIterator<Item = C>) -> Self {
        cells.into_iter().fold(self, Self::with)
    }

    /// The figure as the text of an SVG file.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let rows = self.columns.iter().map(|(_, cells)| cells.len()).max().unwrap_or(0);
        let default = (SIZE.0 * self.columns.len().max(1) as f64, SIZE.1 * rows.max(1) as f64);
        let (width, height) = self.size.unwrap_or(default);
        let shares: f64 = self.columns.iter().map(|(share, _)| share).sum();
        let mut canvas = Canvas::new(width, height);
        let mut x = MARGIN;
        for (share, cells) in &self.columns {
            let wide = (width - 2.0 * MARGIN) * share / shares;
            let high = (height - 2.0 * MARGIN) / cells.len().max(1) as f64;
            let area = |i: usize| Area { x, y: MARGIN + high * i as f64, width: wide, height: high };
            // The axes of a column are aligned.
            let left = (cells.iter().enumerate())
                .map(|(i, cell)| if let Cell::Panel(panel) = cell { panel.left(area(i)) } else { 0.0 })
                .fold(0.0, f64::max);
            for (i, cell) in cells.iter().enumerate() {
                let area = area(i);
                match cell {
                    Cell::Panel(panel) => panel.draw(&mut canvas, area, left),
                    Cell::Space(space) => space.draw(&mut canvas, area),
                    Cell::Sparsity(sparsity) => sparsity.draw(&mut canvas, area),
                }
            }
            x += wide;
        }
        canvas.finish()
    }

    /// Writes the figure to an SVG file, and creates its folder if necessary.
    ///
    /// # Errors
    /// Those of the file system, with the path.
    pub fn save(&self, path: impl AsRef<Path>) -> std::io::Result<()> {
        let path = path.as_ref();
        let named = |error: std::io::Error| {
            std::io::Error::new(error.kind(), std::format!("cannot write {}: {error}", path.display()))
        };
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(named)?;
        }
        std::fs::write(path, self.to_svg()).map_err(named)
    }
}
