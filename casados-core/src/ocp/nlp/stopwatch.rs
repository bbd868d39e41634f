//! Timing of the parts of an iteration.

/// A stopwatch; without a clock all times are zero.
pub(in crate::ocp) struct Stopwatch {
    #[cfg(feature = "std")]
    last_lap: Option<std::time::Instant>,
}

/// In a browser the standard library has no clock, and panics.
#[cfg(feature = "std")]
fn current_time() -> Option<std::time::Instant> {
    (!cfg!(all(target_family = "wasm", target_os = "unknown"))).then(std::time::Instant::now)
}

impl Stopwatch {
    pub fn start() -> Self {
        Self {
            #[cfg(feature = "std")]
            last_lap: current_time(),
        }
    }
    /// The seconds since the last call, or since the start.
    pub fn lap(&mut self) -> f64 {
        #[cfg(feature = "std")]
        if let (Some(now), Some(last)) = (current_time(), self.last_lap) {
            self.last_lap = Some(now);
            return now.duration_since(last).as_secs_f64();
        }
        0.0
    }
}
