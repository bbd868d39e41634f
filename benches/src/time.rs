//! CPU time of one thread: what others run meanwhile on the same core is not counted.

use cpu_time::ThreadTime;
use serde_json::Value;
use std::time::{Duration, Instant};

/// The distribution of samples, in seconds of one call.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    /// Median.
    pub median: f64,
    /// First quartile.
    pub q1: f64,
    /// Third quartile.
    pub q3: f64,
    /// Number of samples.
    pub samples: usize,
}

impl Summary {
    /// Of samples in any order.
    #[must_use]
    pub fn from_samples(mut samples: Vec<f64>) -> Self {
        samples.sort_unstable_by(f64::total_cmp);
        let at = |p: f64| samples.get((p * (samples.len() as f64 - 1.0)).round() as usize).copied();
        let at = |p| at(p).unwrap_or(f64::NAN);
        Self { median: at(0.5), q1: at(0.25), q3: at(0.75), samples: samples.len() }
    }

    /// As a peer answers.
    #[must_use]
    pub fn read(value: &Value) -> Self {
        let number = |key: &str| value[key].as_f64().unwrap_or(f64::NAN);
        let samples = value["samples"].as_u64().unwrap_or(0) as usize;
        Self { median: number("median"), q1: number("q1"), q3: number("q3"), samples }
    }

    /// The same for a part of what was timed.
    #[must_use]
    pub fn divided(self, by: f64) -> Self {
        Self { median: self.median / by, q1: self.q1 / by, q3: self.q3 / by, ..self }
    }
}

/// A sample lasts at least this long: reading the clock is a system call.
const MIN_SAMPLE_DURATION: Duration = Duration::from_micros(200);

/// Times a call: a tenth of the budget to warm up, then samples until it is spent, never fewer than
/// nine.
///
/// # Errors
/// Those of the call.
pub fn measure<E>(budget: Duration, mut call: impl FnMut() -> Result<(), E>) -> Result<Summary, E> {
    let mut repetitions = 1u32;
    let begin = Instant::now();
    loop {
        let start = ThreadTime::now();
        for _ in 0..repetitions {
            call()?;
        }
        if start.elapsed() < MIN_SAMPLE_DURATION {
            repetitions *= 2;
        } else if begin.elapsed() > budget / 10 {
            break;
        }
    }
    let mut samples = Vec::new();
    let begin = Instant::now();
    while samples.len() < 9 || begin.elapsed() < budget {
        let start = ThreadTime::now();
        for _ in 0..repetitions {
            call()?;
        }
        samples.push(start.elapsed().as_secs_f64() / f64::from(repetitions));
    }
    Ok(Summary::from_samples(samples))
}

/// The slope of log y over log x, by least squares.
#[must_use]
pub fn log_log_slope(points: impl Iterator<Item = (f64, f64)>) -> f64 {
    let points: Vec<_> = points.map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = points.len() as f64;
    let (mx, my) = points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (xy, xx) =
        points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + (x - mx) * (y - my), b + (x - mx) * (x - mx)));
    xy / xx
}

/// Keeps this thread, and the processes that it starts, on the last core that it may use.
pub fn pin_to_last_core() -> bool {
    let cores = core_affinity::get_core_ids().unwrap_or_default();
    cores.last().is_some_and(|core| core_affinity::set_for_current(*core))
}
