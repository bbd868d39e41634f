//! Twenty problems of optimal control from plain guesses with default options.

#[path = "../examples/models/ocps/mod.rs"]
mod ocps;

use casados::ocp::{Exact, Formulation, HeapOcp, HeapSqp, SecondOrder};
use ocps::Failure;

fn check<P: Formulation<f64, Dynamics: SecondOrder<f64>>>(ocp: &mut HeapOcp<P>) -> Result<(), Failure> {
    let mut sqp = HeapSqp::new(ocp)?.exact(Exact::default());
    let outcome = sqp.solve(ocp)?;
    println!("{}{outcome}", sqp.log());
    assert!(outcome.is_converged(), "{outcome}");
    Ok(())
}

macro_rules! solved {
    ($($theme:ident::$name:ident),*) => {$(
        #[test]
        fn $name() -> Result<(), Failure> {
            check(&mut ocps::$theme::$name()?)
        }
    )*};
}
ocps::each_ocp!(solved);
