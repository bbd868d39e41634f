//! Pictures are read as people do: numbers at the axes say what lines mean.

use roxmltree::{Document, Node};

type Failure = Box<dyn std::error::Error>;

/// The groups of a class, with a title if one is asked for.
pub fn groups<'a>(document: &'a Document<'a>, class: &str, title: Option<&str>) -> Vec<Node<'a, 'a>> {
    let has_title = |node: &Node<'_, '_>| {
        title.is_none_or(|title| {
            node.children().any(|child| child.has_tag_name("title") && child.text() == Some(title))
        })
    };
    document
        .descendants()
        .filter(|node| {
            node.tag_name().name() == "g" && node.attribute("class") == Some(class) && has_title(node)
        })
        .collect()
}

/// The points of a polyline in pixels.
pub fn pixels(line: &Node<'_, '_>) -> Result<Vec<[f64; 2]>, Failure> {
    let points = line.attribute("points").ok_or("a polyline without points")?;
    let point = |text: &str| -> Result<[f64; 2], Failure> {
        let (x, y) = text.split_once(',').ok_or("a point without a comma")?;
        Ok([x.parse()?, y.parse()?])
    };
    points.split(' ').map(point).collect()
}

/// The lines of a group.
pub fn lines<'a>(group: &Node<'a, 'a>) -> Vec<Node<'a, 'a>> {
    group.descendants().filter(|node| node.tag_name().name() == "polyline").collect()
}

/// A number as it stands at an axis, `10⁻³` too.
fn value(text: &str) -> Result<f64, Failure> {
    let digit = |c: char| match c {
        '⁻' => Some('-'),
        '¹' => Some('1'),
        '²' => Some('2'),
        '³' => Some('3'),
        '⁰' | '⁴'..='⁹' => char::from_digit(c as u32 - '⁰' as u32, 10),
        _ => None,
    };
    let exponent: String = text.chars().filter_map(digit).collect();
    if exponent.is_empty() { Ok(text.parse()?) } else { Ok(10f64.powi(exponent.parse()?)) }
}

/// An axis: from pixels to numbers.
pub struct Axis {
    is_log: bool,
    from: (f64, f64),
    to: (f64, f64),
}

impl Axis {
    /// Of numbers with their pixels, all of which have to fit.
    fn new(mut ticks: Vec<(f64, f64)>) -> Result<Self, Failure> {
        ticks.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (Some(&from), Some(&to)) = (ticks.first(), ticks.last()) else { return Err("no numbers".into()) };
        for is_log in [false, true] {
            let axis = Self { is_log, from, to };
            if ticks.len() >= 3
                && ticks.iter().all(|&(value, pixel)| (axis.pixel(value) - pixel).abs() < 0.11)
            {
                return Ok(axis);
            }
        }
        Err(format!("numbers stand at the wrong places: {ticks:?}").into())
    }

    fn pixel_range(&self, value: f64) -> f64 {
        if self.is_log { value.log10() } else { value }
    }

    /// Where a number is.
    pub fn pixel(&self, value: f64) -> f64 {
        let share = (self.pixel_range(value) - self.pixel_range(self.from.0))
            / (self.pixel_range(self.to.0) - self.pixel_range(self.from.0));
        self.from.1 + share * (self.to.1 - self.from.1)
    }

    /// What number is at a pixel.
    pub fn value(&self, pixel: f64) -> f64 {
        let share = (pixel - self.from.1) / (self.to.1 - self.from.1);
        let place = self.pixel_range(self.from.0)
            + share * (self.pixel_range(self.to.0) - self.pixel_range(self.from.0));
        if self.is_log { 10f64.powf(place) } else { place }
    }
}

/// The axes of a panel: lines of the grid with the numbers beside them.
pub fn axes(panel: &Node<'_, '_>) -> Result<[Axis; 2], Failure> {
    let mut ticks = [Vec::new(), Vec::new()];
    let axes = panel.children().find(|node| node.attribute("class") == Some("axes")).ok_or("no axes")?;
    for text in axes.children().filter(|node| node.tag_name().name() == "text") {
        let Some(line) = text.prev_sibling_element().filter(|node| node.tag_name().name() == "polyline")
        else {
            continue;
        };
        let [from, to] = pixels(&line)?[..] else { return Err("a line of the grid is straight".into()) };
        let axis = usize::from(from[0] != to[0]);
        ticks[axis].push((value(text.text().ok_or("no number")?)?, from[axis]));
    }
    let [x, y] = ticks;
    Ok([Axis::new(x)?, Axis::new(y)?])
}

/// The points of a series in numbers, line by line.
pub fn points(panel: &Node<'_, '_>, series: &Node<'_, '_>) -> Result<Vec<Vec<[f64; 2]>>, Failure> {
    let [x, y] = axes(panel)?;
    let read = |line| Ok(pixels(&line)?.into_iter().map(|p| [x.value(p[0]), y.value(p[1])]).collect());
    let all = series.descendants().filter(|node| node.tag_name().name() == "polyline");
    all.map(read).collect()
}
