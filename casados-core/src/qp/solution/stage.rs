//! Variables and multipliers of one stage.

/// The variables and multipliers of one stage of a solution.
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// let (mut solver, mut solution) = (HeapInteriorPoint::new(), HeapSolution::new(&dims)?);
/// solver.solve(qp.view(), QpStart::Cold, solution.view_mut())?;
/// let first = solution.stages().next().unwrap();
/// // The control is at its lower bound, which pushes; nothing is at the upper one.
/// assert!((first.u[0] + 0.4).abs() < 1e-7 && first.u_lower[0] > 0.1 && first.u_upper[0] < 1e-6);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SolutionStage<'a, T> {
    /// `x`
    pub x: &'a [T],
    /// `u`
    pub u: &'a [T],
    /// `π_{k+1}`, the multipliers of `A x + B u + b − x₊ = 0`
    pub dynamics: &'a [T],
    /// Multipliers of the lower bounds of `x`
    pub x_lower: &'a [T],
    /// Multipliers of the upper bounds of `x`
    pub x_upper: &'a [T],
    /// Multipliers of the lower bounds of `u`
    pub u_lower: &'a [T],
    /// Multipliers of the upper bounds of `u`
    pub u_upper: &'a [T],
    /// Multipliers of the lower bounds of general constraints
    pub g_lower: &'a [T],
    /// Multipliers of the upper bounds of general constraints
    pub g_upper: &'a [T],
}

/// A mutable view of [`SolutionStage`].
///
/// ```
/// # use casados::qp::*;
/// # // x₊ = x + u from x₀ = 1, with |u| ≤ 0.4, three intervals of ½ (x² + 0.1 u²).
/// # let mut dims = [StageDims::new(1, 1, 0); 4];
/// # dims[3].nu = 0;
/// # let mut qp = HeapQp::<f64>::new(&dims)?;
/// # for mut stage in qp.stages_mut() {
/// #     stage.a_mut().set(0, 0, 1.0);
/// #     stage.b_mut().set(0, 0, 1.0);
/// #     stage.q_mut().set(0, 0, 1.0);
/// #     stage.r_mut().set(0, 0, 0.1);
/// #     stage.u_bounds_mut().set(0, -0.4, 0.4);
/// # }
/// # qp.fix_initial_state(&[1.0])?;
/// // A guess: at rest everywhere.
/// let mut guess = HeapSolution::<f64>::new(&dims)?;
/// for k in 0..4 {
///     let stage = guess.stage_mut(k).unwrap();
///     stage.x.fill(1.0);
///     stage.u.fill(0.0);
/// }
/// HeapInteriorPoint::new().solve(qp.view(), QpStart::Warm, guess.view_mut())?;
/// assert!((guess.stage(0).unwrap().u[0] + 0.4).abs() < 1e-6);
/// # Ok::<(), casados::qp::QpError>(())
/// ```
#[derive(Debug)]
pub struct SolutionStageMut<'a, T> {
    /// `x`
    pub x: &'a mut [T],
    /// `u`
    pub u: &'a mut [T],
    /// `π_{k+1}`, the multipliers of `A x + B u + b − x₊ = 0`
    pub dynamics: &'a mut [T],
    /// Multipliers of the lower bounds of `x`
    pub x_lower: &'a mut [T],
    /// Multipliers of the upper bounds of `x`
    pub x_upper: &'a mut [T],
    /// Multipliers of the lower bounds of `u`
    pub u_lower: &'a mut [T],
    /// Multipliers of the upper bounds of `u`
    pub u_upper: &'a mut [T],
    /// Multipliers of the lower bounds of general constraints
    pub g_lower: &'a mut [T],
    /// Multipliers of the upper bounds of general constraints
    pub g_upper: &'a mut [T],
}
