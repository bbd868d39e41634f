//! Restart and degenerate starts.

use super::options;

options! {
    /// The restart of a failed run from a simulation with the controls of the guess.
    ///
    /// ```
    /// use casados::ocp::advanced::RestartOptions;
    ///
    /// assert_eq!(RestartOptions::DEFAULT.restart_after, 16);
    /// ```
    RestartOptions {
        /// The number of consecutive stalled steps after which a run tries to restart.
        restart_after: usize = 16, Any;
        /// Steps of the interior point up to this length are stalled.
        short_step: f64 = 1.0 / 32.0, NotNegative;
        /// A run restarts from a simulation that violates less than this fraction of the iterate.
        restart_gain: f64 = 0.5, Positive;
        /// Violations up to this multiple of those of the simulated guess have not decreased since
        /// the guess, which may be a maximum of them: the controls are perturbed.
        guess_violation_ratio: f64 = 1.1, NotNegative;
        /// The largest ratio of violations of a simulation and of the reference point.
        max_simulated_violation: f64 = 1e3, Positive;
    }
}

options! {
    /// Degenerate starts: a perturbed guess where the gradient of a violated constraint vanishes.
    ///
    /// ```
    /// use casados::ocp::advanced::StartOptions;
    ///
    /// assert_eq!(StartOptions::DEFAULT.relative_perturbation, 0.1);
    /// ```
    StartOptions {
        /// A gradient vanishes if the change of each variable by its size, or by one, changes the
        /// constraint by at most this fraction of the violation.
        vanishing_gradient: f64 = 1e-8, NotNegative;
        /// The relative perturbation of the first variable; variable `i` (from zero) is perturbed
        /// by `1/(i + 1)` of it, so that the point lies on no axis and no diagonal.
        relative_perturbation: f64 = 0.1, Positive;
    }
}
