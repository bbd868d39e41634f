//! The pictures of the guide, one for each chapter that has one; those of the chapters on batches
//! and mechanisms are written by the examples `learn_weights` and `drift`.
//!
//! ```text
//! cargo run --release --example guide [FOLDER]
//! ```

mod integrators;
mod pendulum;
mod problems;

use casados::plot::Figure;
use std::error::Error;
use std::path::PathBuf;

type Picture = Result<Figure, Box<dyn Error>>;

/// Solves the problem of a chapter and draws it.
type DrawPicture = fn() -> Picture;

/// The chapters with their pictures.
const PICTURES: [(&str, DrawPicture); 12] = [
    ("first_model", pendulum::first_model),
    ("roots", integrators::roots),
    ("sensitivities", integrators::sensitivities),
    ("tables", integrators::tables),
    ("integrators", integrators::integrators),
    ("ocp", pendulum::ocp),
    ("formulations", problems::formulations),
    ("trouble", problems::trouble),
    ("mpc", pendulum::mpc),
    ("estimation", problems::estimation),
    ("acados", problems::acados),
    ("casadi", problems::casadi),
];

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "plots".into()));
    for (chapter, picture) in PICTURES {
        picture()?.save(folder.join(format!("{chapter}.svg")))?;
    }
    println!("{} pictures are in {}", PICTURES.len(), folder.display());
    Ok(())
}
