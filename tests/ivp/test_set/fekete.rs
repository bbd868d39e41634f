//! Fekete's points of the Test Set for IVP Solvers: twenty charges on the unit sphere that repel
//! each other in a medium, until they rest as far from each other as they can. Positions are held
//! on the sphere by `μ`, velocities by `λ` (the stabilised form of index 2 of C. W. Gear, B.
//! Leimkuhler, G. K. Gupta).

use casados::dae;

/// Positions at `t = 1000`, one charge a row, by RADAU5 with tolerances of 1e-12 (F. Mazzia, C.
/// Magherini, Test Set for Initial Value Problem Solvers, release 2.4, Fekete problem).
pub const END: [[f64; 3]; 20] = [
    [-0.407_026_338_033_320_2, 0.346_375_877_279_180_2, 0.845_194_245_003_042_9],
    [0.077_529_347_525_215_5, -0.262_866_271_972_299_7, 0.961_712_287_182_914_6],
    [0.710_057_783_334_356_7, 0.121_294_805_558_612, 0.693_617_700_517_221_7],
    [0.234_826_774_455_762_7, 0.744_927_797_692_331_1, 0.624_450_928_595_639_1],
    [-0.434_111_473_878_288_5, 0.878_543_044_226_287_6, 0.199_272_044_423_766],
    [-0.951_505_960_031_259_6, 0.220_350_876_278_700_5, 0.214_666_949_827_400_8],
    [-0.638_519_164_360_987_8, -0.431_083_325_939_068_8, 0.637_542_502_772_212_1],
    [-0.146_417_508_791_433_6, -0.938_087_163_522_886_2, 0.313_933_729_874_469],
    [0.566_697_406_506_994_2, -0.673_922_188_507_654_2, 0.474_007_313_546_215_6],
    [0.984_325_953_844_029_3, -0.169_699_535_781_999_6, -0.048_005_042_906_090_9],
    [0.146_417_508_791_433_1, 0.938_087_163_522_887_5, -0.313_933_729_874_465_6],
    [-0.709_275_754_997_901_4, 0.526_406_263_713_961_6, -0.468_854_293_885_492_9],
    [-0.866_573_181_928_447_8, -0.481_387_805_975_602_4, -0.131_592_935_298_217_8],
    [-0.234_789_777_870_053_8, -0.859_434_040_801_313, -0.454_144_128_795_757_9],
    [0.553_097_694_007_411_8, -0.767_437_026_561_512_4, -0.324_227_314_003_783_3],
    [0.771_105_096_989_692_7, 0.635_704_181_657_703_4, 0.035_736_855_197_770_01],
    [0.710_395_120_937_959_1, 0.240_357_043_128_051_9, -0.661_488_672_591_059_6],
    [-0.030_382_087_387_356_6, 0.450_192_329_364_046_1, -0.892_414_587_144_204_6],
    [-0.577_299_615_810_709_3, -0.176_676_341_497_181_3, -0.797_189_202_096_954_4],
    [0.241_448_176_696_903_9, -0.341_645_681_837_313_5, -0.908_284_650_344_625],
];

/// The start: rings of three, seven, six and four charges at rest; for each ring how many, the
/// latitude and the angle of the first charge as fractions of π.
#[must_use]
pub fn start() -> [f64; 120] {
    let rings = [
        (3, 3.0 / 8.0, 2.0 / 3.0 + 1.0 / 13.0),
        (7, 1.0 / 8.0, 2.0 / 7.0 + 1.0 / 29.0),
        (6, -2.0 / 15.0, 2.0 / 6.0 + 1.0 / 7.0),
        (4, -3.0 / 10.0, 1.0 / 17.0),
    ];
    let mut x = [0.0; 120];
    let mut charge = 0;
    for (count, latitude, first) in rings {
        for k in 0..count {
            let angle = core::f64::consts::PI * (2.0 * f64::from(k) / f64::from(count) + first);
            let (sin, cos) = (core::f64::consts::PI * latitude).sin_cos();
            x[3 * charge..3 * charge + 3].copy_from_slice(&[angle.cos() * cos, angle.sin() * cos, sin]);
            charge += 1;
        }
    }
    x
}

/// Equations and what they share.
#[dae]
pub mod equations {
    /// x = [positions, velocities], three coordinates of each charge; z = [λ, μ].
    #[dae(index_reduction, range(x = -2.0..=2.0, z = -10.0..=10.0))]
    pub fn fekete(xdot: [f64; 120], x: [f64; 120], z: [f64; 40]) -> [f64; 160] {
        let mut residual = [0.0; 160];
        let mut force = [0.0; 60];
        for i in 0..20 {
            for j in 0..i {
                let mut d = [0.0; 3];
                let mut square = 0.0;
                for k in 0..3 {
                    d[k] = x[3 * i + k] - x[3 * j + k];
                    square += d[k] * d[k];
                }
                for k in 0..3 {
                    force[3 * i + k] += d[k] / square;
                    force[3 * j + k] -= d[k] / square;
                }
            }
        }
        for i in 0..20 {
            let mut radius = -1.0;
            let mut along = 0.0;
            for k in 0..3 {
                let n = 3 * i + k;
                residual[n] = xdot[n] - x[60 + n] - 2.0 * z[20 + i] * x[n];
                residual[60 + n] = xdot[60 + n] - force[n] + 0.5 * x[60 + n] - 2.0 * z[i] * x[n];
                radius += x[n] * x[n];
                along += 2.0 * x[n] * x[60 + n];
            }
            residual[120 + i] = radius;
            residual[140 + i] = along;
        }
        residual
    }
}
