//! The picture: at the left the Jacobian, at the right the factors in the order of elimination.

use casados::model::Structure;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn Error>>;

const INK: RGBColor = RGBColor(40, 40, 40);
const FRAME: RGBColor = RGBColor(170, 170, 170);
const EMPTY: RGBColor = RGBColor(246, 246, 246);

const CONSTANT: (&str, RGBColor) = ("constant", RGBColor(150, 170, 195));
const LINEAR: (&str, RGBColor) = ("linear in its variable", RGBColor(31, 95, 168));
const NONLINEAR: (&str, RGBColor) = ("nonlinear", RGBColor(200, 62, 45));

const ORIGINAL: (&str, RGBColor) = ("non-zero of the matrix", RGBColor(31, 95, 168));
const FILL: (&str, RGBColor) = ("fill", RGBColor(230, 145, 20));
const IDENTITY: (&str, RGBColor) = ("pivot that is the identity", RGBColor(60, 140, 70));
const PIVOT: (&str, RGBColor) = ("other pivot", INK);

const MARGIN: i32 = 24;
const HEAD: i32 = 62;
const LEGEND: i32 = 52;

/// A panel: cells of one size, with its top left corner.
struct Panel<'a, 'b> {
    area: &'a Area<'b>,
    left: i32,
    cell: i32,
}

impl Panel<'_, '_> {
    fn corner(&self, row: usize, column: usize) -> (i32, i32) {
        (self.left + self.cell * column as i32, HEAD + self.cell * row as i32)
    }
    fn fill(&self, row: usize, column: usize, colour: RGBColor) -> Drawn {
        let (x, y) = self.corner(row, column);
        let size = (self.cell - 1).max(1);
        self.area.draw(&Rectangle::new([(x, y), (x + size, y + size)], colour.filled()))?;
        Ok(())
    }
    /// The frame of columns, with a name above.
    fn block(&self, name: &str, rows: usize, columns: std::ops::Range<usize>) -> Drawn {
        let ((x0, y0), (x1, y1)) = (self.corner(0, columns.start), self.corner(rows, columns.end));
        self.area.draw(&Rectangle::new([(x0 - 1, y0 - 1), (x1, y1)], EMPTY.filled()))?;
        self.area.draw(&Rectangle::new([(x0 - 1, y0 - 1), (x1, y1)], FRAME.stroke_width(1)))?;
        self.area.draw(&Text::new(name.to_owned(), (x0, y0 - 19), text(15)))?;
        Ok(())
    }
    /// Colours and what they mean, below.
    fn legend(&self, rows: usize, entries: &[(&str, RGBColor)]) -> Drawn {
        let (mut x, y) = (self.left, self.corner(rows, 0).1 + 20);
        for (name, colour) in entries {
            self.area.draw(&Rectangle::new([(x, y), (x + 11, y + 11)], colour.filled()))?;
            self.area.draw(&Text::new((*name).to_owned(), (x + 17, y - 1), text(14)))?;
            x += 44 + 6 * name.chars().count() as i32;
        }
        Ok(())
    }
}

/// Writes an SVG file; its folder is made if there is none.
pub fn draw(structure: &Structure, path: &Path) -> Drawn {
    let rows = structure.linear.len();
    let widths =
        [structure.x.len(), structure.x.len(), structure.z.len(), structure.u.len(), structure.p.len()];
    let columns: usize = widths.iter().sum();
    let cell = (1200 / (columns + rows) as i32).clamp(6, 28);
    let left = MARGIN + (cell * columns as i32 + 2 * MARGIN).max(400);
    let width = left + (cell * rows as i32).max(620) + MARGIN;
    let height = HEAD + cell * rows as i32 + LEGEND;
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (width as u32, height as u32)).into_drawing_area();
        root.fill(&WHITE)?;
        draw_jacobian(structure, widths, &Panel { area: &root, left: MARGIN, cell })?;
        draw_factors(structure, &Panel { area: &root, left, cell })?;
        root.present()?;
    }
    let failed = |error: std::io::Error| format!("cannot write {}: {error}", path.display());
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    std::fs::write(path, svg).map_err(failed)?;
    Ok(())
}

fn draw_jacobian(structure: &Structure, widths: [usize; 5], panel: &Panel) -> Drawn {
    let rows = structure.linear.len();
    let title = format!("{}: Jacobian, {} non-zeros", structure.name, structure.jacobian.len());
    panel.area.draw(&Text::new(title, (panel.left, 8), text(18)))?;
    let mut start = 0;
    for (name, width) in ["∂f/∂ẋ", "∂f/∂x", "∂f/∂z", "∂f/∂u", "∂f/∂p"].iter().zip(widths)
    {
        if width > 0 {
            // A block of one or two columns has no room for more than the name of the variable.
            let name = if panel.cell as usize * width < 48 { &name[name.len() - 1..] } else { name };
            panel.block(name, rows, start..start + width)?;
        }
        start += width;
    }
    let is_curved = |variable: usize| {
        (0..structure.hessian.len()).any(|entry| structure.hessian.at(entry) == (variable, variable))
    };
    for entry in 0..structure.jacobian.len() {
        let (row, column) = structure.jacobian.at(entry);
        let (_, colour) = match structure.constant[entry] {
            true => CONSTANT,
            false if is_curved(column) => NONLINEAR,
            false => LINEAR,
        };
        panel.fill(row, column, colour)?;
    }
    panel.legend(rows, &[CONSTANT, LINEAR, NONLINEAR])
}

fn draw_factors(structure: &Structure, panel: &Panel) -> Drawn {
    let plan = &structure.elimination;
    let size = plan.pivots.len();
    let fill = plan.fill();
    let title =
        format!("Factors in the order of elimination, {} blocks, {fill} of them fill", plan.slots.len());
    panel.area.draw(&Text::new(title, (panel.left, 8), text(18)))?;
    panel.block("pivots, L below, U above", size, 0..size)?;
    // When each slot is eliminated; kinematic states are not.
    let mut position = vec![0; plan.slot_of_equation.len()];
    for (order, pivot) in plan.pivots.iter().enumerate() {
        position[pivot.slot as usize] = order;
    }
    let is_fill =
        |block: usize| plan.assembly.iter().any(|entry| entry.block as usize == block && entry.is_fill());
    let colour = |block: usize| if is_fill(block) { FILL.1 } else { ORIGINAL.1 };
    for (order, pivot) in plan.pivots.iter().enumerate() {
        panel.fill(order, order, if pivot.identity { IDENTITY.1 } else { PIVOT.1 })?;
        for block in pivot.lower() {
            panel.fill(position[plan.slots[block] as usize], order, colour(block))?;
        }
        for block in pivot.upper() {
            panel.fill(order, position[plan.slots[block] as usize], colour(block))?;
        }
    }
    panel.legend(size, &[ORIGINAL, FILL, IDENTITY, PIVOT])
}

fn text(size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}
