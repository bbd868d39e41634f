//! Parameters of the model that are found with the states and controls.
//!
//! ```text
//! variables of a stage   (x, w, u)        of the last one   (x, w)        w the same at all stages
//! ```
//!
//! `w` are shared controls of the QP, in front of the controls of the model: the recursion carries
//! each as one right-hand side. The parameters of the model are those that were set, with `w` in
//! the places of the free ones.

#[cfg(feature = "alloc")]
use crate::qp::element::set;
use crate::scalar::Real;
use crate::shape::Shape;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;

/// No free parameter.
const NOT_FREE: u32 = u32::MAX;

/// The free parameters of a problem.
#[derive(Clone, Debug, Default)]
pub(in crate::ocp) struct FreeParameters {
    /// How many copies of elements of the first state are in front of them.
    #[cfg(feature = "alloc")]
    initial_state_copies: usize,
    /// Which parameter of the model each is.
    #[cfg(feature = "alloc")]
    model_parameters: Vec<usize>,
    /// For every parameter of the model which one of these it is, or [`NONE`].
    #[cfg(feature = "alloc")]
    free_indices: Vec<u32>,
    /// Which one is the end of the horizon.
    #[cfg(feature = "alloc")]
    end_time: Option<usize>,
}

impl FreeParameters {
    /// None, behind so many copies of elements of the first state.
    pub fn with_initial_state_copies(starts: usize) -> Self {
        let _ = starts;
        Self {
            #[cfg(feature = "alloc")]
            initial_state_copies: starts,
            ..Self::default()
        }
    }

    /// For the functions of a problem.
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

    /// How many variables there are for these and for copies of elements of the first state.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.view().count
    }

    /// Which parameter of the model one of them is.
    pub fn model_parameter(&self, index: usize) -> Option<usize> {
        #[cfg(feature = "alloc")]
        return self.model_parameters.get(index.checked_sub(self.initial_state_copies)?).copied();
        #[cfg(not(feature = "alloc"))]
        {
            let _ = index;
            None
        }
    }

    /// The end of the horizon is a parameter that is free.
    #[cfg(feature = "alloc")]
    pub fn set_end_time(&mut self, parameter: usize) {
        self.end_time = self.view().index_of(parameter);
    }

    /// Adds one of `np` parameters of the model: which one of these it is.
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

/// Where free parameters are among the variables `(x, w, u)` of a stage.
#[derive(Clone, Copy, Debug, Default)]
pub struct FreeParametersView<'a> {
    count: usize,
    free_indices: &'a [u32],
    end_time: Option<usize>,
}

impl FreeParametersView<'_> {
    /// Which one is the end of the horizon.
    #[inline(always)]
    pub(in crate::ocp) fn end_time_index(self) -> Option<usize> {
        self.end_time
    }

    /// How long the horizon is in units of its nodes' times: the end time, or one.
    #[inline(always)]
    pub(in crate::ocp) fn duration<T: Real>(self, w: &[T]) -> T {
        self.end_time.and_then(|end| w.get(end).copied()).unwrap_or(T::ONE)
    }

    /// How many there are.
    #[inline(always)]
    pub(in crate::ocp) fn count(self) -> usize {
        self.count
    }

    /// Which one a parameter of the model is.
    #[inline(always)]
    pub(in crate::ocp) fn index_of(self, parameter: usize) -> Option<usize> {
        self.free_indices.get(parameter).filter(|&&place| place != NOT_FREE).map(|&place| place as usize)
    }

    /// The index in `(x, w, u, z)` of a variable in `(ẋ, x, z, u, p, t)`, if it is one of these.
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

    /// Which parameter of the model one is; none of copies of elements of the first state.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn model_parameter(self, index: usize) -> Option<usize> {
        self.free_indices.iter().position(|&place| place as usize == index)
    }

    /// Writes free parameters over those that were set.
    #[inline(always)]
    pub(in crate::ocp) fn write_parameters<T: Real>(self, p: &mut [T], w: &[T]) {
        for (p, &place) in p.iter_mut().zip(self.free_indices) {
            if let Some(&value) = w.get(place as usize) {
                *p = value;
            }
        }
    }

    /// The columns of a matrix over the parameters of the model that are of free ones, each with
    /// which one it is; columns are `rows` long.
    pub(in crate::ocp) fn free_columns<T>(
        self,
        matrix: &[T],
        rows: usize,
    ) -> impl Iterator<Item = (usize, &[T])> {
        let columns = matrix.chunks_exact(rows.max(1)).enumerate();
        columns.filter_map(move |(parameter, column)| Some((self.index_of(parameter)?, column)))
    }

    /// The elements of a gradient over the parameters of the model that are of free ones.
    pub(in crate::ocp) fn free_elements<T: Copy>(self, gradient: &[T]) -> impl Iterator<Item = (usize, T)> {
        let elements = gradient.iter().enumerate();
        elements.filter_map(move |(parameter, &value)| Some((self.index_of(parameter)?, value)))
    }

    /// A step of the parameters of the model, from one of free ones.
    #[cfg(feature = "alloc")]
    pub(in crate::ocp) fn scatter_step<T: Real>(self, step: &mut [T], w: &[T]) {
        for (parameter, &place) in
            self.free_indices.iter().enumerate().filter(|(_, place)| **place != NOT_FREE)
        {
            set(step, parameter, w.get(place as usize).copied().unwrap_or(T::ZERO));
        }
    }
}
