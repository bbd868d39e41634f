//! Names of entries of results.

use crate::model::Dae;
use crate::shape::Shape;
use std::format;
use std::string::String;

pub(super) fn state_name<M: Dae>(i: usize) -> String {
    let (nx, nz) = (M::Shape::NX, M::Shape::NZ);
    if i < nx {
        String::from(M::STRUCTURE.x[i])
    } else if i < nx + nz {
        String::from(M::STRUCTURE.z[i - nx])
    } else {
        format!("{} at the start", M::STRUCTURE.z[i - nx - nz])
    }
}

pub(super) fn direction_name<M: Dae>(i: usize) -> String {
    let s = &M::STRUCTURE;
    let names = s.x.iter().map(|x| (*x, true)).chain(s.u.iter().chain(s.p).map(|w| (*w, false)));
    match names.into_iter().nth(i) {
        Some((name, true)) => format!("{name} at the start"),
        Some((name, false)) => String::from(name),
        None => format!("direction {i}"),
    }
}

pub(super) fn derivative_name<M: Dae>(i: usize) -> String {
    let rows = M::Shape::NX + 2 * M::Shape::NZ;
    format!("{} by {}", state_name::<M>(i % rows), direction_name::<M>(i / rows))
}

pub(super) fn second_derivative_name<M: Dae>(i: usize) -> String {
    let n = M::Shape::NW;
    format!("by {} and {}", direction_name::<M>(i % n), direction_name::<M>(i / n))
}
