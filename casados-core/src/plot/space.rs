//! Curves in three dimensions, in an axonometric view.

use super::axis::ticks;
use super::draw::{Area, colour_bar, draw_coloured_line, value_range};
use super::svg::{Anchor, Canvas, Colour, FONT_HEIGHT, Point, Stroke};
use alloc::string::String;
use alloc::vec::Vec;

type Point3 = [f64; 3];

/// A curve with the numbers that determine its colour.
#[derive(Clone, Debug)]
struct SpaceCurve {
    name: String,
    points: Vec<Point3>,
    values: Vec<f64>,
    colour: Colour,
    width: f64,
}

/// Curves in a box with three axes of equal scale, and their shadows on the floor.
///
/// ```
/// use casados::plot::{Figure, Space};
///
/// let helix = (0..100).map(|i| 0.1 * i as f64).map(|t| [t.cos(), t.sin(), 0.1 * t]);
/// let space = Space::new("Helix").axes(["x, m", "y, m", "z, m"]).line("way", helix);
/// assert!(Figure::new().with(space).to_svg().contains("Helix"));
/// ```
#[derive(Clone, Debug)]
pub struct Space {
    title: String,
    labels: [String; 3],
    /// The view: azimuth from the first axis and elevation above the floor, in degrees.
    azimuth: f64,
    elevation: f64,
    curves: Vec<SpaceCurve>,
    drawn: usize,
}

/// The projection of points to the canvas.
struct View {
    right: Point3,
    up: Point3,
    middle: Point3,
    unit: f64,
    centre: Point,
}

fn dot(a: Point3, b: Point3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl View {
    fn project(&self, place: Point3) -> Point {
        let from_middle = [0, 1, 2].map(|i| place[i] - self.middle[i]);
        let (right, up) = (dot(self.right, from_middle), dot(self.up, from_middle));
        (self.centre.0 + self.unit * right, self.centre.1 - self.unit * up)
    }
}

impl Space {
    /// A box, viewed from 30 degrees above, between its first two axes.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        let labels = ["x", "y", "z"].map(String::from);
        Self { title: title.into(), labels, azimuth: -60.0, elevation: 25.0, curves: Vec::new(), drawn: 0 }
    }

    /// Sets the labels of the axes.
    #[must_use]
    pub fn axes(mut self, labels: [&str; 3]) -> Self {
        self.labels = labels.map(String::from);
        self
    }

    /// Sets the view in degrees: azimuth around the third axis, starting from the first one, and
    /// elevation above the floor (0 to 90).
    #[must_use]
    pub fn seen_from(mut self, azimuth: f64, elevation: f64) -> Self {
        let azimuth = if azimuth.is_finite() { azimuth } else { -60.0 };
        let elevation = if elevation.is_finite() { elevation.clamp(0.0, 90.0) } else { 25.0 };
        (self.azimuth, self.elevation) = (azimuth, elevation);
        self
    }

    /// Adds a curve. Points that are not finite interrupt it.
    #[must_use]
    pub fn line(mut self, name: impl Into<String>, points: impl IntoIterator<Item = Point3>) -> Self {
        let colour = Colour::of(self.drawn);
        self.drawn += 1;
        let points = points.into_iter().collect();
        self.curves.push(SpaceCurve { name: name.into(), points, values: Vec::new(), colour, width: 2.0 });
        self
    }

    /// Adds a curve coloured by a number at each point; a bar at the right shows the scale.
    #[must_use]
    pub fn coloured(
        mut self,
        name: impl Into<String>,
        points: impl IntoIterator<Item = (Point3, f64)>,
    ) -> Self {
        let (points, values) = points.into_iter().unzip();
        self.curves.push(SpaceCurve { name: name.into(), points, values, colour: Colour::INK, width: 4.0 });
        self
    }

    /// Adds the outline of an object in the colour of ink, without a shadow.
    #[must_use]
    pub fn outline(mut self, points: impl IntoIterator<Item = Point3>) -> Self {
        let (name, points) = (String::new(), points.into_iter().collect());
        self.curves.push(SpaceCurve { name, points, values: Vec::new(), colour: Colour::INK, width: 1.5 });
        self
    }

    /// The bounding box.
    fn bounds(&self) -> [(f64, f64); 3] {
        let points = || self.curves.iter().flat_map(|curve| &curve.points);
        let all = [0, 1, 2].map(|i| value_range(points().map(|point| &point[i])));
        let longest = all.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
        let longest = if longest.is_finite() && longest > 0.0 { longest } else { 1.0 };
        all.map(
            |(low, high)| {
                if low <= high { (low - 0.05 * longest, high + 0.05 * longest) } else { (0.0, longest) }
            },
        )
    }

    fn view(&self, bounds: [(f64, f64); 3], area: Area) -> View {
        let (sin_a, cos_a) = self.azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = self.elevation.to_radians().sin_cos();
        let right = [-sin_a, cos_a, 0.0];
        let up = [-cos_a * sin_e, -sin_a * sin_e, cos_e];
        let middle = bounds.map(|(low, high)| 0.5 * (low + high));
        let reach = |axis: Point3| (0..3).map(|i| axis[i].abs() * (bounds[i].1 - bounds[i].0)).sum::<f64>();
        let (wide, high) = (reach(right).max(f64::MIN_POSITIVE), reach(up).max(f64::MIN_POSITIVE));
        let (left, below) = (64.0, 52.0);
        let unit = ((area.width - 2.0 * left) / wide).min((area.height - 2.0 * below) / high).max(0.0);
        View {
            right,
            up,
            middle,
            unit,
            centre: (area.x + 0.5 * area.width, area.y + 0.5 * area.height + 8.0),
        }
    }

    pub(super) fn draw(&self, canvas: &mut Canvas, area: Area) {
        let values = value_range(self.curves.iter().flat_map(|curve| &curve.values));
        let has_bar = values.0 <= values.1;
        let inside = Area { width: area.width - if has_bar { 70.0 } else { 0.0 }, ..area };
        let bounds = self.bounds();
        let view = self.view(bounds, inside);
        canvas.group("space", &self.title, |canvas| {
            canvas.heading((area.x + 12.0, area.y + 18.0), &self.title);
            self.draw_box(canvas, &view, bounds);
            for curve in self.curves.iter().filter(|curve| !curve.name.is_empty()) {
                let shadow: Vec<Point> = curve
                    .points
                    .iter()
                    .map(|p| view.project([p[0], p[1], bounds[2].0 + 0.0 * p[2]]))
                    .collect();
                canvas.line(&shadow, Stroke::new(Colour(200, 200, 205), 2.0));
            }
            for curve in &self.curves {
                let points: Vec<Point> = curve.points.iter().map(|&place| view.project(place)).collect();
                canvas.group("series", &curve.name, |canvas| {
                    if curve.values.is_empty() {
                        canvas.line(&points, Stroke::new(curve.colour, curve.width));
                    } else {
                        draw_coloured_line(canvas, &points, &curve.values, values, curve.width);
                    }
                });
            }
            if has_bar {
                let name = self.curves.iter().find(|curve| !curve.values.is_empty()).map_or("", |c| &c.name);
                let bar = Area { y: area.y + 40.0, height: 0.7 * area.height, ..inside };
                colour_bar(canvas, Area { width: bar.width - 14.0, ..bar }, name, values);
            }
            let named = self.curves.iter().filter(|c| !c.name.is_empty() && c.values.is_empty());
            for (i, curve) in named.enumerate() {
                let (x, y) = (area.x + 12.0, area.y + 36.0 + 18.0 * i as f64);
                canvas.line(&[(x, y), (x + 24.0, y)], Stroke::new(curve.colour, curve.width));
                canvas.draw_text((x + 30.0, y + 0.35 * FONT_HEIGHT), &curve.name, Anchor::Start);
            }
        });
    }

    /// Draws the floor and the two rear walls, with lines at the ticks, whose texts are at the
    /// front edges.
    fn draw_box(&self, canvas: &mut Canvas, view: &View, bounds: [(f64, f64); 3]) {
        let (sin, cos) = self.azimuth.to_radians().sin_cos();
        let [x, y, z] = bounds;
        let (back_x, front_x) = if cos > 0.0 { (x.0, x.1) } else { (x.1, x.0) };
        let (back_y, front_y) = if sin > 0.0 { (y.0, y.1) } else { (y.1, y.0) };
        let grid = Stroke::new(Colour::GRID, 1.0);
        let outwards = |at: Point, by: f64| {
            let (dx, dy) = (at.0 - view.centre.0, at.1 - view.centre.1);
            let length = dx.hypot(dy).max(1.0);
            (at.0 + by * dx / length, at.1 + by * dy / length + 0.35 * FONT_HEIGHT)
        };
        canvas.group("axes", "", |canvas| {
            let count = |i: usize| ((bounds[i].1 - bounds[i].0) * view.unit / 55.0).clamp(1.0, 6.0) as usize;
            for (value, text) in ticks(x.0, x.1, count(0)) {
                let floor = [view.project([value, back_y, z.0]), view.project([value, front_y, z.0])];
                canvas.line(&[view.project([value, back_y, z.1]), floor[0], floor[1]], grid);
                canvas.draw_text(outwards(floor[1], 16.0), &text, Anchor::Middle);
            }
            for (value, text) in ticks(y.0, y.1, count(1)) {
                let floor = [view.project([back_x, value, z.0]), view.project([front_x, value, z.0])];
                canvas.line(&[view.project([back_x, value, z.1]), floor[0], floor[1]], grid);
                canvas.draw_text(outwards(floor[1], 16.0), &text, Anchor::Middle);
            }
            // The ticks of the third axis are at the left one of the two side edges.
            let edges = [[back_x, front_y], [front_x, back_y]];
            let left = |edge: &[f64; 2]| view.project([edge[0], edge[1], z.0]).0;
            let edge = if left(&edges[0]) <= left(&edges[1]) { edges[0] } else { edges[1] };
            for (value, text) in ticks(z.0, z.1, count(2)) {
                let corner = view.project([back_x, back_y, value]);
                let (one, other) =
                    (view.project([front_x, back_y, value]), view.project([back_x, front_y, value]));
                canvas.line(&[one, corner, other], grid);
                let at = view.project([edge[0], edge[1], value]);
                canvas.draw_text((at.0 - 6.0, at.1 + 0.35 * FONT_HEIGHT), &text, Anchor::End);
            }
            let frame = Stroke::new(Colour(150, 150, 150), 1.0);
            let corner = |x: f64, y: f64, z: f64| view.project([x, y, z]);
            let floor = [
                (back_x, back_y),
                (front_x, back_y),
                (front_x, front_y),
                (back_x, front_y),
                (back_x, back_y),
            ];
            canvas.line(&floor.map(|(x, y)| corner(x, y, z.0)), frame);
            canvas.line(
                &[(front_x, back_y), (back_x, back_y), (back_x, front_y)].map(|(x, y)| corner(x, y, z.1)),
                frame,
            );
            for (x, y) in [(back_x, back_y), (front_x, back_y), (back_x, front_y)] {
                canvas.line(&[corner(x, y, z.0), corner(x, y, z.1)], frame);
            }
            let middle = |range: (f64, f64)| 0.5 * (range.0 + range.1);
            canvas.draw_text(
                outwards(corner(middle(x), front_y, z.0), 38.0),
                &self.labels[0],
                Anchor::Middle,
            );
            canvas.draw_text(
                outwards(corner(front_x, middle(y), z.0), 38.0),
                &self.labels[1],
                Anchor::Middle,
            );
            let top = corner(edge[0], edge[1], z.1);
            canvas.draw_text((top.0, top.1 - 10.0), &self.labels[2], Anchor::Middle);
        });
    }
}
