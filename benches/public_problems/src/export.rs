//! The problem that the variable `CASADOS_PROBLEM` names, for `casadi.nlpsol`.

use crate::{families, sets};
use casados::casadi::{Library, Problems, Program};

fn named() -> Result<Box<dyn Program>, Box<dyn std::error::Error>> {
    let name = std::env::var("CASADOS_PROBLEM")?;
    if let Ok(refinement) = std::env::var("CASADOS_REFINEMENT") {
        families::refine(refinement.parse()?);
    }
    let all = sets::all();
    let entry = all.iter().find(|entry| entry.facts.name == name);
    entry.ok_or_else(|| format!("no problem is called {name}"))?.program()
}

static LIBRARY: Library<Problems> = Library::new(|| Ok(Problems::new(named)));
casados_core::__casadi_function!(LIBRARY, 0, "", nlp, "");
casados_core::__casadi_function!(LIBRARY, 1, "", nlp, "_f");
casados_core::__casadi_function!(LIBRARY, 2, "", nlp, "_g");
casados_core::__casadi_function!(LIBRARY, 3, "", nlp, "_grad_f");
casados_core::__casadi_function!(LIBRARY, 4, "", nlp, "_jac_g");
casados_core::__casadi_function!(LIBRARY, 5, "", nlp, "_hess_l");
casados_core::__casadi_function!(LIBRARY, 6, "", nlp, "_grad");
casados_core::__casadi_function!(LIBRARY, 7, "", nlp, "_bounds");
