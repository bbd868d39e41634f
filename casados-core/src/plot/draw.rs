//! Drawing of panels as shapes.

use super::axis::{Scale, three_digit_text};
use super::curve::Curve;
use super::panel::Panel;
use super::svg::{Anchor, Canvas, Colour, FONT_HEIGHT, Point, Stroke, text_width};
use alloc::string::String;
use alloc::vec::Vec;

/// A rectangle of the canvas.
#[derive(Clone, Copy, Debug)]
pub(super) struct Area {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

/// The approximate number of pixels between two ticks.
const TICK_SPACING: [f64; 2] = [85.0, 32.0];
/// The height of a row of the legend, and the width of the colour bar, in pixels.
const ROW: f64 = 18.0;
const BAR: f64 = 84.0;
const GAP: f64 = 8.0;
/// The number of colours in a colour bar.
const SHADES: usize = 32;

impl Area {
    fn shrunk_by(&self, left: f64, top: f64, right: f64, bottom: f64) -> Self {
        Self {
            x: self.x + left,
            y: self.y + top,
            width: (self.width - left - right).max(10.0),
            height: (self.height - top - bottom).max(10.0),
        }
    }
}

/// The names and colours of a legend in rows of at most `room` pixels.
fn legend(series: &[(&Curve, Colour)], room: f64) -> Vec<Vec<(String, Stroke, f64)>> {
    let mut rows: Vec<Vec<(String, Stroke, f64)>> = Vec::new();
    let mut right = f64::INFINITY;
    for (series, colour) in series {
        if series.name.is_empty() || !series.values.is_empty() {
            continue;
        }
        let stroke = Stroke { colour: *colour, width: series.width, dashed: series.dashed };
        let width = 32.0 + text_width(&series.name) + 12.0;
        if right + width > room {
            rows.push(Vec::new());
            right = 0.0;
        }
        if let Some(row) = rows.last_mut() {
            row.push((series.name.clone(), stroke, right));
        }
        right += width;
    }
    rows
}

/// The range of the numbers that determine colours.
pub(super) fn value_range<'a>(values: impl Iterator<Item = &'a f64>) -> (f64, f64) {
    let finite = values.copied().filter(|value| value.is_finite());
    finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

/// Draws a line of varying colour in pieces of constant shade.
pub(super) fn draw_coloured_line(
    canvas: &mut Canvas,
    points: &[Point],
    values: &[f64],
    (low, high): (f64, f64),
    width: f64,
) {
    let shade = |value: f64| {
        let share = (value - low) / (high - low).max(f64::MIN_POSITIVE);
        (share.clamp(0.0, 1.0) * (SHADES - 1) as f64).round() as usize
    };
    let mut begin = 0;
    for i in 1..=points.len().min(values.len()) {
        let here = values.get(begin).copied().map_or(0, shade);
        let is_same = values.get(i).is_some_and(|&value| shade(value) == here);
        if !is_same {
            let end = (i + 1).min(points.len());
            let colour = Colour::mix(here as f64 / (SHADES - 1) as f64);
            canvas.line(points.get(begin..end).unwrap_or_default(), Stroke::new(colour, width));
            begin = i;
        }
    }
}

/// Draws the colour bar at the right of an area.
pub(super) fn colour_bar(canvas: &mut Canvas, area: Area, name: &str, (low, high): (f64, f64)) {
    let (left, top, height) = (area.x + area.width + 14.0, area.y + 18.0, 0.7 * area.height);
    canvas.group("scale", name, |canvas| {
        canvas.draw_text((left - 2.0, area.y + 6.0), name, Anchor::Start);
        let step = height / SHADES as f64;
        for i in 0..SHADES {
            let colour = Colour::mix(1.0 - i as f64 / (SHADES - 1) as f64);
            canvas.rectangle((left, top + step * i as f64), (10.0, step + 0.3), Some(colour), None);
        }
        for share in [0.0, 0.5, 1.0] {
            let text = three_digit_text(low + share * (high - low));
            canvas.draw_text(
                (left + 15.0, top + height * (1.0 - share) + 0.35 * FONT_HEIGHT),
                &text,
                Anchor::Start,
            );
        }
    });
}

/// The layout of a panel, and its colours.
struct Layout<'a> {
    coloured: Vec<(&'a Curve, Colour)>,
    legend: Vec<Vec<(String, Stroke, f64)>>,
    /// The range of the numbers that determine colours, if any.
    values: Option<(f64, f64)>,
    /// The top of the legend's rows, and of the axes.
    begin: f64,
    top: f64,
    bottom: f64,
    right: f64,
}

impl Panel {
    fn layout(&self, area: Area) -> Layout<'_> {
        let mut next = 0;
        let coloured: Vec<(&Curve, Colour)> = (self.series.iter())
            .map(|series| {
                let colour = series.colour.unwrap_or_else(|| {
                    next += 1;
                    Colour::of(next - 1)
                });
                (series, colour)
            })
            .collect();
        let values = Some(value_range(self.series.iter().flat_map(|series| &series.values)));
        let values = values.filter(|(low, high)| low <= high);
        let legend = legend(&coloured, area.width - 40.0);
        let begin = if self.title.is_empty() { 6.0 } else { 28.0 };
        let top = begin + ROW * legend.len() as f64 + 4.0;
        let bottom = 24.0 + if self.x.label.is_empty() { 0.0 } else { 18.0 };
        let right = if values.is_some() { BAR } else { 16.0 };
        Layout { coloured, legend, values, begin, top, bottom, right }
    }

    /// The width of the tick texts and the label at the left of the axes, in pixels.
    pub(super) fn left(&self, area: Area) -> f64 {
        let Layout { top, bottom, right, .. } = self.layout(area);
        let inside = area.shrunk_by(0.0, top, right, bottom);
        let numbers = self.y_scale(inside).ticks((inside.height / TICK_SPACING[1]) as usize);
        let widest = numbers.iter().map(|(_, text)| text_width(text)).fold(0.0, f64::max);
        GAP + widest + 6.0 + if self.y.label.is_empty() { 0.0 } else { 20.0 }
    }

    /// Draws the panel with a given width at the left, at least the required one.
    pub(super) fn draw(&self, canvas: &mut Canvas, area: Area, left: f64) {
        let layout = self.layout(area);
        let inside = area.shrunk_by(left, layout.top, layout.right, layout.bottom);
        let (x, y) = self.scales(inside);
        canvas.group("panel", &self.title, |canvas| {
            canvas.heading((area.x + left, area.y + 18.0), &self.title);
            draw_legend(canvas, (area.x + left, area.y + layout.begin), &layout.legend);
            self.draw_axes(canvas, (area.x, inside), [&x, &y]);
            let data = |canvas: &mut Canvas| self.draw_data(canvas, inside, &layout, [&x, &y]);
            if self.x.given.is_some() || self.y.given.is_some() {
                canvas.clipped((inside.x, inside.y), (inside.width, inside.height), data);
            } else {
                data(canvas);
            }
            if let Some(values) = layout.values {
                let name = self.series.iter().find(|series| !series.values.is_empty());
                colour_bar(canvas, inside, name.map_or("", |series| &series.name), values);
            }
        });
    }

    fn draw_data(&self, canvas: &mut Canvas, inside: Area, layout: &Layout<'_>, [x, y]: [&Scale; 2]) {
        self.draw_field(canvas, [x, y]);
        for &limit in &self.limits {
            let stroke = Stroke { colour: Colour::RED, width: 1.0, dashed: true };
            let line = [(inside.x, y.at(limit)), (inside.x + inside.width, y.at(limit))];
            canvas.group("limit", "", |canvas| canvas.line(&line, stroke));
        }
        let values = layout.values.unwrap_or_default();
        for (series, colour) in &layout.coloured {
            canvas.group("series", &series.name, |canvas| series.draw(canvas, [x, y], *colour, values));
        }
        for (at, words) in &self.texts {
            canvas.draw_text((x.at(at.0) + 5.0, y.at(at.1) - 5.0), words, Anchor::Start);
        }
    }

    fn y_scale(&self, area: Area) -> Scale {
        let all = self.series.iter().flat_map(|series| &series.points).map(|point| point.1);
        self.y.scale(all.chain(self.limits.iter().copied()), area.y + area.height..area.y, 0.06)
    }

    fn scales(&self, area: Area) -> (Scale, Scale) {
        let mut y = self.y_scale(area);
        let all = self.series.iter().flat_map(|series| &series.points).map(|point| point.0);
        let room = if self.is_equal { 0.06 } else { 0.0 };
        let mut x = self.x.scale(all, area.x..area.x + area.width, room);
        if self.is_equal {
            let unit = x.unit().max(y.unit());
            x.widen(unit);
            y.widen(unit);
        }
        (x, y)
    }

    /// Draws the frame, the grid, the ticks and the labels.
    fn draw_axes(&self, canvas: &mut Canvas, (border, inside): (f64, Area), [x, y]: [&Scale; 2]) {
        let (right, bottom) = (inside.x + inside.width, inside.y + inside.height);
        let grid = Stroke::new(Colour::GRID, 1.0);
        canvas.group("axes", "", |canvas| {
            for (value, text) in self.x.ticks(x, (inside.width / TICK_SPACING[0]) as usize) {
                let at = x.at(value);
                canvas.line(&[(at, inside.y), (at, bottom)], grid);
                canvas.draw_text((at, bottom + 16.0), &text, Anchor::Middle);
            }
            for (value, text) in y.ticks((inside.height / TICK_SPACING[1]) as usize) {
                let at = y.at(value);
                canvas.line(&[(inside.x, at), (right, at)], grid);
                canvas.draw_text((inside.x - 6.0, at + 0.35 * FONT_HEIGHT), &text, Anchor::End);
            }
            let size = (inside.width, inside.height);
            canvas.rectangle((inside.x, inside.y), size, None, Some(Colour::INK));
            canvas.draw_text((inside.x + 0.5 * inside.width, bottom + 35.0), &self.x.label, Anchor::Middle);
            canvas.vertical_text((border + FONT_HEIGHT + 2.0, inside.y + 0.5 * inside.height), &self.y.label);
        });
    }

    /// Draws strokes of equal length, each starting at a dot.
    fn draw_field(&self, canvas: &mut Canvas, [x, y]: [&Scale; 2]) {
        const ARROW_SPACING: f64 = 22.0;
        let Some(field) = self.field else { return };
        let (wide, high) = ((x.to - x.from).abs(), (y.to - y.from).abs());
        let mut strokes = Vec::new();
        for i in 0..(wide / ARROW_SPACING) as usize {
            for j in 0..(high / ARROW_SPACING) as usize {
                let at = (x.from + ARROW_SPACING * (i as f64 + 0.5), y.to + ARROW_SPACING * (j as f64 + 0.5));
                let [dx, dy] = field([x.value(at.0), y.value(at.1)]);
                let (dx, dy) = (dx / x.unit(), -dy / y.unit());
                let length = dx.hypot(dy);
                if length > 0.0 && length.is_finite() {
                    strokes.push([at, (at.0 + 14.0 * dx / length, at.1 + 14.0 * dy / length)]);
                }
            }
        }
        let colour = Colour(170, 175, 190);
        canvas.group("field", "", |canvas| {
            canvas.strokes(&strokes, Stroke::new(colour, 1.0));
            let dots: Vec<[Point; 2]> = strokes.iter().map(|&[at, _]| [at, at]).collect();
            canvas.strokes(&dots, Stroke::new(colour, 3.0));
        });
    }
}

fn draw_legend(canvas: &mut Canvas, at: Point, rows: &[Vec<(String, Stroke, f64)>]) {
    for (i, row) in rows.iter().enumerate() {
        let y = at.1 + ROW * (i as f64 + 0.5);
        for (name, stroke, left) in row {
            let from = at.0 + left;
            if stroke.width > 0.0 {
                canvas.line(&[(from, y), (from + 24.0, y)], *stroke);
            } else {
                canvas.dot((from + 14.0, y), 3.0, stroke.colour);
            }
            canvas.draw_text((from + 30.0, y + 0.35 * FONT_HEIGHT), name, Anchor::Start);
        }
    }
}

impl Curve {
    fn draw(&self, canvas: &mut Canvas, [x, y]: [&Scale; 2], colour: Colour, values: (f64, f64)) {
        let points: Vec<Point> = self.points.iter().map(|point| (x.at(point.0), y.at(point.1))).collect();
        if !self.values.is_empty() {
            draw_coloured_line(canvas, &points, &self.values, values, self.width);
        } else if self.width > 0.0 {
            canvas.line(&points, Stroke { colour, width: self.width, dashed: self.dashed });
        }
        if self.radius > 0.0 {
            points.iter().for_each(|&point| canvas.dot(point, self.radius, colour));
        }
    }
}
