//! Sparsity patterns: the entries of a model's matrices, and their kinds.

use super::draw::Area;
use super::svg::{Anchor, Canvas, Colour, FONT_HEIGHT, text_width};
use crate::structure::Structure;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// The name of a kind of entries, and its colour.
type Kind = (&'static str, Colour);

const CONSTANT: Kind = ("constant", Colour(150, 170, 195));
const LINEAR: Kind = ("linear in its variable", Colour::BLUE);
const NONLINEAR: Kind = ("nonlinear", Colour::RED);

const ORIGINAL: Kind = ("non-zero of the matrix", Colour::BLUE);
const FILL: Kind = ("fill", Colour::ORANGE);
const IDENTITY: Kind = ("pivot that is the identity", Colour::GREEN);
const PIVOT: Kind = ("other pivot", Colour::INK);

/// The sparsity pattern of a matrix.
///
/// ```
/// # use casados::plot::{Figure, Sparsity};
/// # use casados::prelude::*;
/// # #[ode]
/// # fn cart(x: [f64; 2], u: f64) -> [f64; 2] { [x[1], u] }
/// let figure = Figure::new().with(Sparsity::jacobian(Cart::describe()));
/// assert!(figure.to_svg().contains("Cart: Jacobian, 4 non-zeros"));
/// ```
#[derive(Clone, Debug)]
pub struct Sparsity {
    title: String,
    rows: usize,
    /// The names of blocks, with their numbers of columns.
    blocks: Vec<(&'static str, usize)>,
    /// Row, column, kind.
    entries: Vec<(usize, usize, Kind)>,
    kinds: &'static [Kind],
}

impl Sparsity {
    /// The Jacobian of a model: equations by variables.
    ///
    /// ```
    /// use casados::plot::{Figure, Sparsity};
    /// use casados::prelude::*;
    ///
    /// #[ode]
    /// fn decay(x: f64, p: f64) -> f64 { -p * x }
    ///
    /// let structure = Decay::describe();
    /// let figure = Figure::new().with(Sparsity::jacobian(structure)).with(Sparsity::factors(structure));
    /// assert!(figure.to_svg().contains("Decay: Jacobian, 3 non-zeros"));
    /// ```
    #[must_use]
    pub fn jacobian(structure: &Structure) -> Self {
        let names = ["∂f/∂ẋ", "∂f/∂x", "∂f/∂z", "∂f/∂u", "∂f/∂p"];
        let nx = structure.x.len();
        let widths = [nx, nx, structure.z.len(), structure.u.len(), structure.p.len()];
        let is_curved = |variable: usize| structure.hessian.iter().any(|at| at == (variable, variable));
        let entries = structure.jacobian.iter().zip(structure.constant).map(|((row, column), constant)| {
            let kind = match constant {
                true => CONSTANT,
                false if is_curved(column) => NONLINEAR,
                false => LINEAR,
            };
            (row, column, kind)
        });
        Self {
            title: format!("{}: Jacobian, {} non-zeros", structure.name, structure.jacobian.len()),
            rows: structure.linear.len(),
            blocks: names.into_iter().zip(widths).filter(|(_, width)| *width > 0).collect(),
            entries: entries.collect(),
            kinds: &[CONSTANT, LINEAR, NONLINEAR],
        }
    }

    /// The factors of the Newton matrix in the order of elimination: pivots on the diagonal, `L`
    /// below, `U` above.
    #[must_use]
    pub fn factors(structure: &Structure) -> Self {
        let plan = &structure.elimination;
        // The position of each slot in the elimination; kinematic states have none.
        let mut position = alloc::vec![0; plan.slot_of_equation.len().max(plan.pivots.len())];
        for (order, pivot) in plan.pivots.iter().enumerate() {
            if let Some(place) = position.get_mut(pivot.slot as usize) {
                *place = order;
            }
        }
        let place = |block: usize| {
            plan.slots.get(block).and_then(|&slot| position.get(slot as usize)).copied().unwrap_or(0)
        };
        let is_fill =
            |block: usize| plan.assembly.iter().any(|entry| entry.block as usize == block && entry.is_fill());
        let kind = |block: usize| if is_fill(block) { FILL } else { ORIGINAL };
        let mut entries = Vec::new();
        for (order, pivot) in plan.pivots.iter().enumerate() {
            entries.push((order, order, if pivot.identity { IDENTITY } else { PIVOT }));
            entries.extend(pivot.lower().map(|block| (place(block), order, kind(block))));
            entries.extend(pivot.upper().map(|block| (order, place(block), kind(block))));
        }
        let (size, fill) = (plan.pivots.len(), plan.fill());
        Self {
            title: format!("{}: factors, {} blocks, {fill} of them fill", structure.name, plan.slots.len()),
            rows: size,
            blocks: alloc::vec![("in the order of elimination", size)],
            entries,
            kinds: &[ORIGINAL, FILL, IDENTITY, PIVOT],
        }
    }

    pub(super) fn draw(&self, canvas: &mut Canvas, area: Area) {
        let columns: usize = self.blocks.iter().map(|(_, width)| width).sum();
        let rows = self.legend(area.width - 24.0);
        let below = 16.0 + 18.0 * rows.last().map_or(0.0, |(_, _, row)| row + 1.0);
        let (left, top) = (area.x + 12.0, area.y + 52.0);
        let wide = (area.width - 24.0) / columns.max(1) as f64;
        let high = (area.height - 52.0 - below) / self.rows.max(1) as f64;
        let cell = wide.min(high).clamp(0.5, 28.0);
        canvas.group("sparsity", &self.title, |canvas| {
            canvas.heading((left, area.y + 18.0), &self.title);
            let mut start = left;
            for (name, count) in &self.blocks {
                let across = cell * *count as f64;
                canvas.rectangle(
                    (start, top),
                    (across, cell * self.rows as f64),
                    Some(Colour(246, 246, 246)),
                    Some(Colour(170, 170, 170)),
                );
                // A block of one or two columns has room for the name of the variable only.
                let short = name.rsplit('∂').next().unwrap_or(name);
                let name = if text_width(name) > across { short } else { name };
                canvas.draw_text((start + 1.0, top - 6.0), name, Anchor::Start);
                start += across;
            }
            let size = (cell - if cell > 4.0 { 1.0 } else { 0.0 }).max(0.5);
            for &(row, column, (_, colour)) in &self.entries {
                let at = (left + cell * column as f64 + 0.5, top + cell * row as f64 + 0.5);
                canvas.rectangle(at, (size, size), Some(colour), None);
            }
            for ((name, colour), across, row) in rows {
                let (x, y) = (left + across, top + cell * self.rows as f64 + 14.0 + 18.0 * row);
                canvas.rectangle((x, y), (FONT_HEIGHT - 2.0, FONT_HEIGHT - 2.0), Some(colour), None);
                canvas.draw_text((x + 16.0, y + FONT_HEIGHT - 3.0), name, Anchor::Start);
            }
        });
    }

    /// The kinds of entries with their horizontal positions and rows.
    fn legend(&self, room: f64) -> Vec<(Kind, f64, f64)> {
        let (mut across, mut row) = (0.0, 0.0);
        let place = |&kind: &Kind| {
            let wide = 30.0 + text_width(kind.0);
            if across > 0.0 && across + wide > room {
                (across, row) = (0.0, row + 1.0);
            }
            let placed = (kind, across, row);
            across += wide;
            placed
        };
        self.kinds.iter().map(place).collect()
    }
}
