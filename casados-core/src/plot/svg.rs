//! Shapes as SVG text, on a canvas in pixels with the origin at its top left corner.

use alloc::format;
use alloc::string::{String, ToString};
use core::fmt::{self, Write as _};

/// A point of the canvas.
pub(super) type Point = (f64, f64);

/// A colour: red, green, blue.
///
/// ```
/// use casados::plot::{Colour, Curve, Figure, Panel};
///
/// let curve = |i: usize| Curve::line("", [(0.0, i as f64), (1.0, 0.0)]).colour(Colour::of(i));
/// let panel = (0..3).map(curve).fold(Panel::new("The palette"), Panel::with);
/// assert_eq!(Colour::of(8), Colour::BLUE); // it begins again
/// assert!(Figure::new().with(panel).to_svg().contains("#1f5fa8"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

impl Colour {
    /// The colour of frames, numbers and outlines.
    pub const INK: Self = Self(40, 40, 40);
    /// The colour of grid lines.
    pub const GRID: Self = Self(225, 225, 225);
    /// The first of the [palette](Self::of).
    pub const BLUE: Self = Self(31, 95, 168);
    /// The second of the palette.
    pub const ORANGE: Self = Self(230, 145, 20);
    /// The third of the palette.
    pub const GREEN: Self = Self(60, 140, 70);
    /// The fourth of the palette; the colour of limits.
    pub const RED: Self = Self(200, 62, 45);
    /// The fifth of the palette.
    pub const PURPLE: Self = Self(120, 80, 160);

    const PALETTE: [Self; 8] = [
        Self::BLUE,
        Self::ORANGE,
        Self::GREEN,
        Self::RED,
        Self::PURPLE,
        Self(90, 170, 190),
        Self(150, 100, 60),
        Self(110, 110, 110),
    ];

    /// A colour of the palette, which repeats after eight.
    #[must_use]
    pub fn of(index: usize) -> Self {
        Self::PALETTE[index % Self::PALETTE.len()]
    }

    /// A colour from dark blue at 0 over green to yellow at 1.
    #[must_use]
    pub fn mix(share: f64) -> Self {
        Self::interpolate(&[Self(38, 60, 130), Self(60, 140, 140), Self(245, 200, 60)], share)
    }

    /// A shade from light at 0 to dark at 1.
    #[must_use]
    pub fn shade(share: f64) -> Self {
        Self::interpolate(&[Self(205, 205, 215), Self(15, 15, 90)], share)
    }

    fn interpolate(stops: &[Self], share: f64) -> Self {
        let position = share.clamp(0.0, 1.0) * (stops.len().max(2) - 2 + 1) as f64;
        let first = (position as usize).min(stops.len().saturating_sub(2));
        let weight = position - first as f64;
        match stops.get(first..) {
            Some(&[from, to, ..]) => {
                let channel =
                    |a: u8, b: u8| (f64::from(a) + weight * (f64::from(b) - f64::from(a))).round() as u8;
                Self(channel(from.0, to.0), channel(from.1, to.1), channel(from.2, to.2))
            }
            _ => Self::INK,
        }
    }
}

impl fmt::Display for Colour {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}

/// The appearance of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    pub colour: Colour,
    pub width: f64,
    pub dashed: bool,
}

impl Stroke {
    pub fn new(colour: Colour, width: f64) -> Self {
        Self { colour, width, dashed: false }
    }
}

/// The position of a text's point: at its start, in its middle, at its end.
#[derive(Clone, Copy, Debug)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// The height of letters in pixels.
pub(super) const FONT_HEIGHT: f64 = 13.0;

/// The approximate width of a text in pixels.
pub(super) fn text_width(text: &str) -> f64 {
    0.56 * FONT_HEIGHT * text.chars().count() as f64
}

/// A picture under construction.
pub(super) struct Canvas {
    text: String,
}

/// A number with one decimal, limited to the range that programs can read.
fn coordinate_text(value: f64) -> String {
    const LARGEST_COORDINATE: f64 = 1e6;
    let value = if value.is_nan() { 0.0 } else { value.clamp(-LARGEST_COORDINATE, LARGEST_COORDINATE) };
    let text = format!("{value:.1}");
    let short = text.strip_suffix(".0").unwrap_or(&text);
    if short == "-0" { "0".to_string() } else { short.to_string() }
}

fn is_finite(point: &Point) -> bool {
    point.0.is_finite() && point.1.is_finite()
}

/// Escapes text for XML 1.0, which excludes all control characters but three.
fn escape(text: &str) -> String {
    let is_none = |c: char| (c < ' ' && !"\t\n\r".contains(c)) || ['\u{fffe}', '\u{ffff}'].contains(&c);
    text.replace(is_none, "\u{fffd}")
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

impl Canvas {
    pub fn new(width: f64, height: f64) -> Self {
        let (width, height) = (coordinate_text(width), coordinate_text(height));
        let text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"{FONT_HEIGHT}\" \
             fill=\"{}\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
            Colour::INK
        );
        Self { text }
    }

    pub fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }

    fn push(&mut self, line: fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        let _ = self.text.write_fmt(line);
        self.text.push('\n');
    }

    /// A group with a title, which browsers show as a tooltip.
    pub fn group(&mut self, class: &str, title: &str, draw: impl FnOnce(&mut Self)) {
        self.push(format_args!("<g class=\"{class}\">"));
        if !title.is_empty() {
            self.push(format_args!("<title>{}</title>", escape(title)));
        }
        draw(self);
        self.push(format_args!("</g>"));
    }

    /// Clips the drawing to a rectangle.
    pub fn clipped(&mut self, at: Point, size: Point, draw: impl FnOnce(&mut Self)) {
        let (x, y, w, h) =
            (coordinate_text(at.0), coordinate_text(at.1), coordinate_text(size.0), coordinate_text(size.1));
        self.push(format_args!(
            "<svg x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" viewBox=\"{x} {y} {w} {h}\">"
        ));
        draw(self);
        self.push(format_args!("</svg>"));
    }

    /// A line through points; points that are not finite interrupt it.
    pub fn line(&mut self, points: &[Point], stroke: Stroke) {
        for piece in points.split(|point| !is_finite(point)) {
            self.polyline(piece, stroke);
        }
    }

    fn polyline(&mut self, points: &[Point], stroke: Stroke) {
        let mut drawn = String::new();
        let mut last: Option<Point> = None;
        for (i, &point) in points.iter().enumerate() {
            let is_near = last.is_some_and(|l| (l.0 - point.0).abs() + (l.1 - point.1).abs() < 0.3);
            if is_near && i + 1 < points.len() {
                continue;
            }
            if last.is_some() {
                drawn.push(' ');
            }
            drawn.push_str(&coordinate_text(point.0));
            drawn.push(',');
            drawn.push_str(&coordinate_text(point.1));
            last = Some(point);
        }
        if points.len() < 2 {
            return;
        }
        let dashes = if stroke.dashed { " stroke-dasharray=\"5 4\"" } else { "" };
        self.push(format_args!(
            "<polyline points=\"{drawn}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" \
             stroke-linejoin=\"round\"{dashes}/>",
            stroke.colour,
            coordinate_text(stroke.width),
        ));
    }

    /// Strokes of the same appearance with round ends: one of length zero is a dot.
    pub fn strokes(&mut self, strokes: &[[Point; 2]], stroke: Stroke) {
        let mut path = String::new();
        for [from, to] in strokes.iter().filter(|ends| ends.iter().all(is_finite)) {
            let [x, y, end_x, end_y] = [from.0, from.1, to.0, to.1].map(coordinate_text);
            let _ = write!(path, "M{x},{y}L{end_x},{end_y}");
        }
        let (colour, width) = (stroke.colour, coordinate_text(stroke.width));
        self.push(format_args!(
            "<path d=\"{path}\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linecap=\"round\"/>"
        ));
    }

    pub fn dot(&mut self, at: Point, radius: f64, colour: Colour) {
        if is_finite(&at) {
            let (x, y, r) = (coordinate_text(at.0), coordinate_text(at.1), coordinate_text(radius));
            self.push(format_args!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"{colour}\"/>"));
        }
    }

    pub fn rectangle(&mut self, at: Point, size: Point, fill: Option<Colour>, frame: Option<Colour>) {
        let (x, y, w, h) =
            (coordinate_text(at.0), coordinate_text(at.1), coordinate_text(size.0), coordinate_text(size.1));
        let none = || "none".to_string();
        let fill = fill.map_or_else(none, |colour| colour.to_string());
        let frame = frame.map_or_else(none, |colour| colour.to_string());
        self.push(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" fill=\"{fill}\" stroke=\"{frame}\"/>"
        ));
    }

    pub fn draw_text(&mut self, at: Point, text: &str, anchor: Anchor) {
        self.styled_text(at, text, anchor, "");
    }

    /// The heading of a panel.
    pub fn heading(&mut self, at: Point, text: &str) {
        self.styled_text(at, text, Anchor::Start, " font-size=\"15\" font-weight=\"bold\"");
    }

    /// A text upwards.
    pub fn vertical_text(&mut self, at: Point, text: &str) {
        let turn = format!(" transform=\"rotate(-90 {} {})\"", coordinate_text(at.0), coordinate_text(at.1));
        self.styled_text(at, text, Anchor::Middle, &turn);
    }

    fn styled_text(&mut self, at: Point, text: &str, anchor: Anchor, more: &str) {
        if text.is_empty() || !is_finite(&at) {
            return;
        }
        let anchor = match anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let (x, y) = (coordinate_text(at.0), coordinate_text(at.1));
        self.push(format_args!("<text x=\"{x}\" y=\"{y}\"{anchor}{more}>{}</text>", escape(text)));
    }
}
