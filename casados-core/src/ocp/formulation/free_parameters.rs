//! Free parameters: parameters of the model that are optimised with states and controls.
//!
//! ```text
//! variables of a stage   (x, w, u)        of the last one   (x, w)        w the same at all stages
//! ```
//!
//! The free parameters `w` are shared controls of the QP, in front of the controls of the model;
//! each is one right-hand side of the Riccati recursion. The model's parameters are the set values,
//! with `w` in the places of the free ones.

#[cfg(feature = "alloc")]
use crate::qp::element::set;
use crate::scalar::Real;
use crate::shape::Shape;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;

/// Marks a parameter that is not free.
const NOT_FREE: u32 = u32::MAX;

/// The free parameters of a problem.
#[derive(Clone, Debug, Default)]
pub(in crate::ocp) struct FreeParameters {
    /// The number of copies of elements of the first state, which are in front of the free
    /// parameters.
    #[cfg(feature = "alloc")]
    initial_state_copies: usize,
    /// The index in the model of each free parameter.
    #[cfg(feature = "alloc")]
    model_parameters: Vec<usize>,
    /// The index among the free parameters of each parameter of the model, or [`NOT_FREE`].
    #[cfg(feature = "alloc")]
    free_indices: Vec<u32>,
    /// The index of the end time among the free parameters.
    #[cfg(feature = "alloc")]
    end_time: Option<usize>,
}

impl FreeParameters {
    /// No free parameters, behind this number of copies of elements of the first state.
    pub fn with_initial_state_copies(initial_state_copies: usize) -> Self {
        let _ = initial_state_copies;
        Self {
            #[cfg(feature = "alloc")]
            initial_state_copies,
            ..Self::default()
        }
    }

    /// Returns a view for the functions of the problem.
    #[inline(always)]
    pub fn view(&self) -> FreeParametersView<'_> {
        #[cfg(feature = "alloc")]
        return FreeParametersView {
            count: self.initial_state_copies + self.model_parameters.len(),
            free_indices: &self.free_indices,
            end_time: self.end_time,
        };
        #[cfg(not(feature = "alloc"))]
        FreeParametersView { count: 0, free_indices: &[], end_time: None }
    }

    /// Returns the number of copies of the first state and free parameters.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.view().count
    }

    /// Returns the parameter of the model that a shared variable is.
    pub fn model_parameter(&self, index: usize) -> Option<usize> {
        #[cfg(feature = "alloc")]
        return self.model_parameters.get(index.checked_sub(self.initial_state_copies)?).copied();
        #[cfg(not(feature = "alloc"))]
        {
            let _ = index;
            None
        }
    }

    /// Declares a free parameter to be the end time of the horizon.
    #[cfg(feature = "alloc")]
    pub fn set_end_time(&mut self, parameter: usize) {
        self.end_time = self.view().index_of(parameter);
    }

    /// Adds one of `np` parameters of the model; returns its index among the shared variables.
    #[cfg(feature = "alloc")]
    pub fn add(&mut self, parameter: usize, np: usize) -> usize {
        self.free_indices.resize(np, NOT_FREE);
        let index = self.initial_state_copies + self.model_parameters.len();
        match self.free_indices.get_mut(parameter) {
            Some(place) if *place == NOT_FREE => *place = index as u32,
            place => return place.map_or(index, |place| *place as usize),
        }
        self.model_parameters.push(parameter);
        index
    }
}

/// The positions of free parameters among the variables `(x, w, u)` of a stage.
#[derive(Clone, Copy, Debug, Default)]
pub struct FreeParametersView<'a> {
    count: usize,
    free_indices: &'a [u32],
    end_time: Option<usize>,
}

impl FreeParametersView<'_> {
    /// Returns the index of the end time among the shared variables.
    #[inline(always)]
    pub(in crate::ocp) fn end_time_index(self) -> Option<usize> {
        self.end_time
    }

    /// Returns the factor of the times of the nodes: the end time if it is free, otherwise one.
    #[inline(always)]
    pub(in crate::ocp) fn duration<T: Real>(self, w: &[T]) -> T {
        self.end_time.and_then(|end| w.get(end).copied()).unwrap_or(T::ONE)
    }

    /// Returns the number of shared variables.
    #[inline(always)]
    pub(in crate::ocp) fn count(self) -> usize {
        self.count
    }

    /// Returns the index of a parameter of the model among the shared variables.
    #[inline(always)]
    pub(in crate::ocp) fn index_of(self, parameter: usize) -> Option<usize> {
        self.free_indices.get(parameter).filter(|&&place| place != NOT_FREE).map(|&place| place as usize)
    }

    /// Maps the index of a variable in `(ẋ, x, z, u, p, t)` to its index in `(x, w, u, z)`, if it
    /// has one.
    #[inline(always)]
    pub(in crate::ocp) fn position<S: Shape>(self, variable: usize) -> Option<usize> {
        let (nx, nz, nu) = (S::NX, S::NZ, S::NU);
        let after_u = 2 * nx + nz + nu;
        if (nx..2 * nx).contains(&variable) {
            Some(variable - nx)
        } else if (2 * nx..2 * nx + nz).contains(&variable) {
            Some(variable - nx + nu + self.count)
        } else if (2 * nx + nz..after_u).contains(&variable) {
            Some(variable - nx - nz + self.count)
        } else {
            self.index_of(variable.checked_sub(after_u)?).map(|w| nx + w)
        }
    }

    /// Returns the parameter of the model that a shared variable is; none for copies of the first
    /// state.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn model_parameter(self, index: usize) -> Option<usize> {
        self.free_indices.iter().position(|&place| place as usize == index)
    }

    /// Overwrites the free parameters in `p`.
    #[inline(always)]
    pub(in crate::ocp) fn write_parameters<T: Real>(self, p: &mut [T], w: &[T]) {
        for (p, &place) in p.iter_mut().zip(self.free_indices) {
            if let Some(&value) = w.get(place as usize) {
                *p = value;
            }
        }
    }

    /// Returns the columns of free parameters of a matrix over the parameters of the model, each
    /// with its index. Columns have `rows` elements.
    pub(in crate::ocp) fn free_columns<T>(
        self,
        matrix: &[T],
        rows: usize,
    ) -> impl Iterator<Item = (usize, &[T])> {
        let columns = matrix.chunks_exact(rows.max(1)).enumerate();
        columns.filter_map(move |(parameter, column)| Some((self.index_of(parameter)?, column)))
    }

    /// Returns the elements of free parameters of a gradient over the parameters of the model, each
    /// with its index.
    pub(in crate::ocp) fn free_elements<T: Copy>(self, gradient: &[T]) -> impl Iterator<Item = (usize, T)> {
        let elements = gradient.iter().enumerate();
        elements.filter_map(move |(parameter, &value)| Some((self.index_of(parameter)?, value)))
    }

    /// Writes a step of the free parameters as a step of the parameters of the model.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn scatter_step<T: Real>(self, step: &mut [T], w: &[T]) {
        for (parameter, &place) in
            self.free_indices.iter().enumerate().filter(|(_, place)| **place != NOT_FREE)
        {
            set(step, parameter, w.get(place as usize).copied().unwrap_or(T::ZERO));
        }
    }
}
