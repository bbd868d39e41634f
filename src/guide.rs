#![doc = include_str!("guide/links.md")]
#![doc = include_str!("../docs/guide/README.md")]

/// Pages of `docs/`. Links between them and pictures are defined where they stand; the definitions
/// of this documentation come first, and hold.
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
