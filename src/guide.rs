#![doc = include_str!("guide/links.md")]
#![doc = include_str!("../docs/guide/README.md")]

/// The pages of `docs/`. Markdown uses the first definition of a link: the definitions here replace
/// those at the end of a page, which are relative to the repository.
macro_rules! chapters {
    ($($name:ident $file:literal)*) => { $(
        #[doc = include_str!("guide/links.md")]
        #[doc = concat!(
            "[picture]: https://raw.githubusercontent.com/casados/casados/main/docs/guide/",
            stringify!($name),
            ".svg\n"
        )]
        #[doc = include_str!(concat!("../docs/", $file))]
        pub mod $name {}
    )* };
}

chapters! {
    first_model "guide/first_model.md"
    roots "guide/roots.md"
    sensitivities "guide/sensitivities.md"
    tables "guide/tables.md"
    integrators "guide/integrators.md"
    ocp "guide/ocp.md"
    formulations "guide/formulations.md"
    trouble "guide/trouble.md"
    mpc "guide/mpc.md"
    batches "guide/batches.md"
    estimation "guide/estimation.md"
    firmware "guide/firmware.md"
    testing "guide/testing.md"
    performance "guide/performance.md"
    acados "guide/acados.md"
    casadi "guide/casadi.md"
    mechanics "mechanics.md"
    language "language.md"
    embedded "embedded.md"
}
