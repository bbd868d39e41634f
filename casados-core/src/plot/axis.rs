//! Axes: the conversion of numbers to pixels, and the ticks.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::ops::Range;

/// An axis of a panel.
#[derive(Clone, Debug, Default)]
pub(super) struct Axis {
    pub label: String,
    pub is_log: bool,
    /// Labels at 0, 1, 2, … that replace numbers.
    pub names: Vec<String>,
    /// The given range; by default it follows from the data.
    pub given: Option<(f64, f64)>,
}

/// An axis with its range and its pixels.
#[derive(Clone, Debug)]
pub(super) struct Scale {
    pub is_log: bool,
    /// The ends of the range; exponents of ten on a logarithmic axis.
    pub low: f64,
    pub high: f64,
    /// The pixels of both ends.
    pub from: f64,
    pub to: f64,
}

impl Axis {
    /// About `count` ticks with their texts; or the names.
    pub fn ticks(&self, scale: &Scale, count: usize) -> Vec<(f64, String)> {
        if self.names.is_empty() {
            return scale.ticks(count);
        }
        self.names.iter().enumerate().map(|(i, name)| (i as f64, name.clone())).collect()
    }

    /// The scale over the pixels `from..to` for the data.
    pub fn scale(&self, data: impl Iterator<Item = f64>, pixels: Range<f64>, room: f64) -> Scale {
        let place = |value: f64| if self.is_log { value.log10() } else { value };
        let (low, high) = match self.given {
            Some((low, high)) => (place(low), place(high)),
            None => {
                let (low, high) = data
                    .map(place)
                    .filter(|value| value.is_finite())
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
                // Half of the length: the whole may overflow.
                let more = 2.0 * room * (0.5 * high - 0.5 * low);
                match low <= high {
                    true => ((low - more).max(f64::MIN), (high + more).min(f64::MAX)),
                    false => (low, high),
                }
            }
        };
        let (low, high) = nonempty_range(low, high);
        Scale { is_log: self.is_log, low, high, from: pixels.start, to: pixels.end }
    }
}

/// A range of positive length, from any numbers.
fn nonempty_range(low: f64, high: f64) -> (f64, f64) {
    if !(low.is_finite() && high.is_finite()) {
        return (0.0, 1.0);
    }
    let (low, high) = (low.min(high), low.max(high));
    let least = 1e-9 * low.abs().max(high.abs()).max(1e-300);
    if high - low > least {
        return (low, high);
    }
    let half = if low == 0.0 { 0.5 } else { 0.05 * low.abs() };
    (low - half, high + half)
}

impl Scale {
    /// The pixel of a number; not finite if the number has none.
    pub fn at(&self, value: f64) -> f64 {
        let value = if self.is_log { value.log10() } else { value };
        self.from + self.fraction_of_range(value) * (self.to - self.from)
    }

    /// The position of a number, or an exponent, between both ends; halved, so that differences do
    /// not overflow.
    fn fraction_of_range(&self, value: f64) -> f64 {
        (0.5 * value - 0.5 * self.low) / (0.5 * self.high - 0.5 * self.low)
    }

    /// The number at a pixel.
    pub fn value(&self, pixel: f64) -> f64 {
        let share = (pixel - self.from) / (self.to - self.from);
        let value = (1.0 - share) * self.low + share * self.high;
        if self.is_log { 10f64.powf(value) } else { value }
    }

    /// Whether a number is on the axis.
    pub fn contains(&self, value: f64) -> bool {
        let value = if self.is_log { value.log10() } else { value };
        (-1e-9..=1.0 + 1e-9).contains(&self.fraction_of_range(value))
    }

    /// Extends the range so that a pixel corresponds to `unit`.
    pub fn widen(&mut self, unit: f64) {
        let (half, middle) = (0.5 * unit * (self.to - self.from).abs(), 0.5 * (self.low + self.high));
        (self.low, self.high) = ((middle - half).max(f64::MIN), (middle + half).min(f64::MAX));
    }

    /// The length that corresponds to a pixel.
    pub fn unit(&self) -> f64 {
        (0.5 * self.high - 0.5 * self.low) / (0.5 * (self.to - self.from).abs().max(1.0))
    }

    /// About `count` ticks with their texts.
    pub fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        if !self.is_log {
            return ticks(self.low, self.high, count);
        }
        // Exponents of numbers; the smallest are subnormal.
        let exponent = |value: f64| value.clamp(-323.0, 308.0) as i32;
        let (first, last) = (exponent(self.low.ceil()), exponent(self.high.floor()));
        let decades = last - first + 1;
        if decades >= 3 {
            let every = (decades as usize).div_ceil(count.max(2)) as i32;
            let shown = (first..=last).filter(|exponent| exponent.rem_euclid(every) == 0);
            return shown.map(|exponent| (power_of_ten(exponent), power_of_ten_text(exponent))).collect();
        }
        let mut all = Vec::new();
        for exponent in first - 1..=last + 1 {
            for digit in [1.0, 2.0, 5.0] {
                let value = digit * power_of_ten(exponent);
                if value.is_finite() && self.contains(value) {
                    all.push((value, fixed_point_text(value)));
                }
            }
        }
        all
    }
}

/// A power of ten, also a subnormal one: `powi` divides by its inverse, which is infinite.
fn power_of_ten(exponent: i32) -> f64 {
    if exponent < -300 { 10f64.powf(f64::from(exponent)) } else { 10f64.powi(exponent) }
}

/// Multiples of 1, 2 or 5 times a power of ten.
pub(super) fn ticks(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let raw = high / count.max(1) as f64 - low / count.max(1) as f64;
    let decade = 10f64.powf(raw.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * decade >= 0.999 * raw).unwrap_or(10.0);
    let step = factor * decade;
    if !(step.is_finite() && step > 0.0) {
        return Vec::new();
    }
    let digits = (-step.log10() - 1e-9).ceil().clamp(0.0, 17.0) as usize;
    let largest = low.abs().max(high.abs());
    let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
    // Numbers that equal their neighbours in floating point have no ticks.
    let all = (0..=(last - first).clamp(0.0, 100.0) as usize).map(|i| (first + i as f64) * step);
    let is_wide = !(1e-2..1e5).contains(&largest);
    let precision = (largest / step).log10().ceil().clamp(0.0, 17.0) as usize;
    all.map(|value| {
        let text = match value {
            0.0 => "0".to_string(),
            _ if is_wide => scientific_text(value, precision),
            _ => format!("{value:.digits$}"),
        };
        (value, text)
    })
    .collect()
}

/// A text with three digits.
pub(super) fn three_digit_text(value: f64) -> String {
    let unit = 10f64.powf(value.abs().log10().floor() - 2.0);
    fixed_point_text(if unit > 0.0 && unit.is_finite() { (value / unit).round() * unit } else { value })
}

/// A text with at most four decimals.
pub(super) fn fixed_point_text(value: f64) -> String {
    if value != 0.0 && !(1e-3..1e5).contains(&value.abs()) {
        return scientific_text(value, 3);
    }
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// A text with a power of ten, without trailing zeros.
fn scientific_text(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let short = if digits > 0 { mantissa.trim_end_matches('0').trim_end_matches('.') } else { mantissa };
    format!("{short}e{exponent}")
}

/// The text of a power of ten.
fn power_of_ten_text(exponent: i32) -> String {
    let raised = |c: char| match c {
        '-' => '⁻',
        '0' => '⁰',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        _ => '⁹',
    };
    match exponent {
        -2..=3 => fixed_point_text(10f64.powi(exponent)),
        _ => format!("10{}", exponent.to_string().chars().map(raised).collect::<String>()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick_texts(low: f64, high: f64, count: usize) -> Vec<String> {
        ticks(low, high, count).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn round_numbers_stand_at_an_axis() {
        assert_eq!(tick_texts(-0.1, 1.05, 5), ["0", "0.5", "1.0"]);
        assert_eq!(tick_texts(0.0, 10.0, 5), ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(tick_texts(1.7, 1.9, 4), ["1.70", "1.75", "1.80", "1.85", "1.90"]);
        assert_eq!(tick_texts(0.0, 4e6, 4), ["0", "1e6", "2e6", "3e6", "4e6"]);
        assert_eq!(tick_texts(0.0, 2e-5, 2), ["0", "1e-5", "2e-5"]);
        // Neighbours differ, however close they are.
        assert_eq!(tick_texts(1.79951, 1.79953, 2), ["1.79951", "1.79952", "1.79953"]);
        assert_eq!(tick_texts(1.0e6 + 100.0, 1.0e6 + 300.0, 2), ["1.0001e6", "1.0002e6", "1.0003e6"]);
        assert_eq!(
            (three_digit_text(8.6572), three_digit_text(-1234.5), three_digit_text(0.0)),
            ("8.66".into(), "-1230".into(), "0".into())
        );
    }

    #[test]
    fn a_logarithmic_axis_has_powers_of_ten() {
        let axis = Axis { is_log: true, ..Axis::default() };
        let scale = axis.scale([1e-8, 1e2].into_iter(), 0.0..100.0, 0.0);
        let ticks = scale.ticks(4);
        assert_eq!(ticks.iter().map(|(_, text)| text.as_str()).collect::<Vec<_>>(), ["10⁻⁶", "10⁻³", "1"]);
        assert!((scale.at(1e-3) - 50.0).abs() < 1e-9);
        // Zero and negative numbers have no position, and do not change the range.
        let scale = axis.scale([0.0, -1.0, 2.0, 6.0].into_iter(), 0.0..100.0, 0.0);
        assert_eq!(scale.ticks(4).iter().map(|(value, _)| *value).collect::<Vec<_>>(), [2.0, 5.0]);
        assert!(!scale.at(0.0).is_finite());
    }

    #[test]
    fn a_range_has_a_length_whatever_the_data() {
        let wide = [f64::MIN, f64::MAX];
        for data in [&[][..], &[3.0], &[f64::NAN, f64::INFINITY], &[0.0, 0.0], &[-1e300, 1e300], &wide] {
            let scale = Axis::default().scale(data.iter().copied(), 0.0..100.0, 0.05);
            assert!(scale.high > scale.low && scale.ticks(5).len() < 20, "{data:?}: {scale:?}");
        }
    }
}
