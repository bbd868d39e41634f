//! The macros that export the functions of an integrator.

/// Exports an integrator to CasADi: the functions `name`, `jac_name`, `adj1_name` and
/// `jac_adj1_name` of a `cdylib`, for `casadi.external("name", "./lib….so")`; see
/// [`casadi`](crate::casadi).
///
/// The integrator and the length of its interval may be followed, in this order, by
/// `quadrature = F`, whose integrals are the output `qf`, and by fields of
/// [`Settings`](crate::casadi::Settings).
///
/// ```text
/// casados::casadi::export! {
///     pendulum = Irk<Pendulum, Gauss<2>>, interval = 0.2, options = Options { steps: 4, ..Default::default() }
/// }
/// ```
#[doc(hidden)]
#[macro_export]
macro_rules! __casadi_export {
    ($name:ident = $integrator:ty, interval = $interval:expr, quadrature = $integrand:ty $(, $field:ident = $value:expr)* $(,)?) => {
        $crate::__casadi_export!(@ $name, $integrator, $crate::casadi::Of<$integrand>, $interval, $($field = $value)*);
    };
    ($name:ident = $integrator:ty, interval = $interval:expr $(, $field:ident = $value:expr)* $(,)?) => {
        $crate::__casadi_export!(@ $name, $integrator, $crate::casadi::Nothing, $interval, $($field = $value)*);
    };
    (@ $name:ident, $integrator:ty, $integrals:ty, $interval:expr, $($field:ident = $value:expr)*) => {
        const _: () = {
            type Functions = $crate::casadi::Integrators<$integrator, $integrals>;
            static LIBRARY: $crate::casadi::Library<Functions> = $crate::casadi::Library::new(|| {
                #[allow(unused_mut)]
                let mut settings = $crate::casadi::Settings::new($interval);
                $(settings.$field = $value;)*
                Ok(Functions::new(settings))
            });
            $crate::__casadi_functions!(LIBRARY, $name);
        };
    };
    ($($other:tt)*) => {
        ::core::compile_error!(
            "write `name = Integrator<…>, interval = seconds`, then if they are wanted `quadrature = F` and fields of `Settings`"
        );
    };
}

/// Exports a batch to CasADi: the functions of [`export!`](crate::casadi::export) for all
/// successive intervals of a horizon in one call. `x0`, `u`, `p` and `xf` have one column for each.
/// The results of the last two inputs are cached by default.
///
/// ```text
/// casados::casadi::export_horizon! {
///     pendulums = Batch<Pendulum, Gauss<2>>, interval = 0.2, intervals = 40, options = Options { steps: 4, ..Default::default() }
/// }
/// ```
#[doc(hidden)]
#[macro_export]
macro_rules! __casadi_export_horizon {
    ($name:ident = $batch:ty, interval = $interval:expr, intervals = $count:expr $(, $field:ident = $value:expr)* $(,)?) => {
        const _: () = {
            type Functions = $crate::casadi::Horizons<$batch>;
            static LIBRARY: $crate::casadi::Library<Functions> = $crate::casadi::Library::new(|| {
                let mut settings = $crate::casadi::Settings::new($interval);
                settings.cache = 2;
                $(settings.$field = $value;)*
                Functions::new(settings, $count)
            });
            $crate::__casadi_functions!(LIBRARY, $name);
        };
    };
    ($($other:tt)*) => {
        ::core::compile_error!(
            "write `name = Batch<…>, interval = seconds, intervals = number`, then if they are wanted fields of `Settings`"
        );
    };
}

/// Exports an optimal control problem to CasADi: `casadi.nlpsol("s", "ipopt", "./lib….so")` solves
/// it, with all derivatives computed in the library; see [`casadi`](crate::casadi).
///
/// This is the problem called `nlp`. Further problems of the same library have other names: they
/// are functions `name`, `name_bounds`, `name_trajectory`, …, for larger problems.
///
/// ```text
/// fn swing() -> Result<impl Program, Box<dyn Error>> { … }
/// casados::casadi::export_problem! { swing }
/// casados::casadi::export_problem! { second = swing_of_another_kind }
/// ```
#[doc(hidden)]
#[macro_export]
macro_rules! __casadi_export_problem {
    ($make:path) => {
        $crate::__casadi_export_problem!(nlp = $make);
    };
    ($name:ident = $make:path) => {
        const _: () = {
            static LIBRARY: $crate::casadi::Library<$crate::casadi::Problems> =
                $crate::casadi::Library::new(|| {
                    Ok($crate::casadi::Problems::new(|| Ok(::std::boxed::Box::new($make()?))))
                });
            $crate::__casadi_function!(LIBRARY, 0, "", $name, "");
            $crate::__casadi_function!(LIBRARY, 1, "", $name, "_f");
            $crate::__casadi_function!(LIBRARY, 2, "", $name, "_g");
            $crate::__casadi_function!(LIBRARY, 3, "", $name, "_grad_f");
            $crate::__casadi_function!(LIBRARY, 4, "", $name, "_jac_g");
            $crate::__casadi_function!(LIBRARY, 5, "", $name, "_hess_l");
            $crate::__casadi_function!(LIBRARY, 6, "", $name, "_grad");
            $crate::__casadi_function!(LIBRARY, 7, "", $name, "_bounds");
            $crate::__casadi_function!(LIBRARY, 8, "jac_", $name, "");
            $crate::__casadi_function!(LIBRARY, 9, "adj1_", $name, "");
            $crate::__casadi_function!(LIBRARY, 10, "jac_adj1_", $name, "");
            $crate::__casadi_function!(LIBRARY, 11, "", $name, "_trajectory");
            /// The number of integrated intervals, for tests.
            #[unsafe(export_name = concat!(stringify!($name), "_integrations"))]
            extern "C" fn integrations() -> ::core::ffi::c_longlong {
                $crate::casadi::ffi::integrations(&LIBRARY)
            }
        };
    };
}

/// Exports the four functions of an integrator.
#[doc(hidden)]
#[macro_export]
macro_rules! __casadi_functions {
    ($library:ident, $name:ident) => {
        $crate::__casadi_function!($library, 0, "", $name, "");
        $crate::__casadi_function!($library, 1, "jac_", $name, "");
        $crate::__casadi_function!($library, 2, "adj1_", $name, "");
        $crate::__casadi_function!($library, 3, "jac_adj1_", $name, "");
        /// The number of integrated intervals, for tests.
        #[unsafe(export_name = concat!(stringify!($name), "_integrations"))]
        extern "C" fn integrations() -> ::core::ffi::c_longlong {
            $crate::casadi::ffi::integrations(&$library)
        }
    };
}

/// Exports one function of a library, with its queries by CasADi.
#[doc(hidden)]
#[macro_export]
macro_rules! __casadi_function {
    ($library:ident, $function:literal, $prefix:literal, $name:ident, $suffix:literal) => {
        const _: () = {
            use ::core::ffi::{c_char, c_int, c_longlong};
            use $crate::casadi::ffi;
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix))]
            unsafe extern "C" fn evaluate(
                arguments: *const *const f64,
                results: *mut *mut f64,
                _: *mut c_longlong,
                _: *mut f64,
                memory: c_int,
            ) -> c_int {
                // SAFETY: the caller guarantees the conditions of `ffi::evaluate`.
                unsafe { ffi::evaluate(&$library, $function, arguments, results, memory) }
            }
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix, "_n_in"))]
            extern "C" fn n_in() -> c_longlong {
                ffi::count(&$library, $function, ffi::Side::Input)
            }
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix, "_n_out"))]
            extern "C" fn n_out() -> c_longlong {
                ffi::count(&$library, $function, ffi::Side::Output)
            }
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix, "_name_in"))]
            extern "C" fn name_in(index: c_longlong) -> *const c_char {
                ffi::name(&$library, $function, ffi::Side::Input, index)
            }
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix, "_name_out"))]
            extern "C" fn name_out(index: c_longlong) -> *const c_char {
                ffi::name(&$library, $function, ffi::Side::Output, index)
            }
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix, "_sparsity_in"))]
            extern "C" fn sparsity_in(index: c_longlong) -> *const c_longlong {
                ffi::sparsity(&$library, $function, ffi::Side::Input, index)
            }
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix, "_sparsity_out"))]
            extern "C" fn sparsity_out(index: c_longlong) -> *const c_longlong {
                ffi::sparsity(&$library, $function, ffi::Side::Output, index)
            }
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix, "_work"))]
            unsafe extern "C" fn work(
                arguments: *mut c_longlong,
                results: *mut c_longlong,
                integers: *mut c_longlong,
                numbers: *mut c_longlong,
            ) -> c_int {
                // SAFETY: the caller guarantees the conditions of `ffi::work`.
                unsafe { ffi::work(&$library, $function, [arguments, results, integers, numbers]) }
            }
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix, "_checkout"))]
            extern "C" fn checkout() -> c_int {
                ffi::check_out(&$library)
            }
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix, "_release"))]
            extern "C" fn release(memory: c_int) {
                ffi::release(&$library, memory);
            }
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix, "_incref"))]
            extern "C" fn incref() {
                ffi::add_reference(&$library);
            }
            #[unsafe(export_name = concat!($prefix, stringify!($name), $suffix, "_decref"))]
            extern "C" fn decref() {
                ffi::remove_reference(&$library);
            }
        };
    };
}
