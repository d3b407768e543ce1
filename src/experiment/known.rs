//! Form factors between whole surfaces with certified digits, for the two built-in scenes with occluders.
//!
//! They are computed independently of this crate, by nested adaptive quadrature on exactly clipped polygons, and listed in the scenes' own pages in `scenes/`.

use crate::scene::{Scene, builtin};

/// Known form factors between all surfaces of a scene.
pub(super) struct Known {
    /// The form factors F_ST, row-major.
    pub(super) values: Vec<f64>,
    /// A bound on the absolute error of each.
    pub(super) error: f64,
}

/// Returns the known form factors of a scene, which must have exactly the faces and surfaces of a built-in one, with any materials.
pub(super) fn surface_form_factors(scene: &Scene) -> Option<Known> {
    if is_builtin(scene, "corridor") {
        let values = CORRIDOR.as_flattened().to_vec();
        return Some(Known { values, error: 1e-11 });
    }
    if is_builtin(scene, "room-box") {
        let values = ROOM_BOX.as_flattened().to_vec();
        return Some(Known { values, error: 5e-10 });
    }
    None
}

fn is_builtin(scene: &Scene, name: &str) -> bool {
    let Ok(built) = builtin::build(name, None) else {
        return false;
    };
    let known = built.scene;
    let same_face = |face| {
        let (a, b) = (scene.polygon(face), known.polygon(face));
        let of = face.0 as usize;
        a == b && scene.faces[of].surface == known.faces[of].surface
    };
    scene.surfaces == known.surfaces && scene.faces.len() == known.faces.len() && scene.face_ids().all(same_face)
}

/// Form factors of A, B, partition, partition_back.
///
/// A to B is half of the unoccluded value; the rest follows by reciprocity and symmetry.
const CORRIDOR: [[f64; 4]; 4] = [
    [0.0, A_TO_B, A_TO_PARTITION, 0.0],
    [A_TO_B, 0.0, 0.0, A_TO_PARTITION],
    [2.0 * A_TO_PARTITION, 0.0, 0.0, 0.0],
    [0.0, 2.0 * A_TO_PARTITION, 0.0, 0.0],
];
const A_TO_B: f64 = 0.102_930_079_594_358_68;
const A_TO_PARTITION: f64 = 0.193_191_244_633_067_53;

/// Form factors of room_x0 … room_z1, box_x0 … box_z1.
///
/// Rows add up to 1 within 3e-11; reciprocity holds within 5e-10.
#[rustfmt::skip]
const ROOM_BOX: [[f64; 12]; 12] = [
    [
        0.0, 0.125_419_022_931_474_22, 0.139_130_592_440_539_74, 0.144_778_910_176_829_23,
        0.217_242_367_012_246_97, 0.243_841_617_552_985_1, 0.091_153_452_158_268_78, 0.0,
        0.009_850_426_530_051_495, 0.012_901_686_620_396_969, 0.002_862_928_512_973_992_5, 0.012_818_996_093_310_534,
    ],
    [
        0.125_419_022_928_424_72, 0.0, 0.148_452_579_624_503_9, 0.150_944_656_304_993_85,
        0.239_488_335_220_383_35, 0.253_409_685_378_593_93, 0.0, 0.063_983_210_607_801_63,
        0.004_513_233_751_512_006, 0.006_589_911_475_610_342, 0.001_107_071_071_361_827, 0.006_092_293_636_392_006,
    ],
    [
        0.173_913_240_523_070_2, 0.185_565_724_533_673_32, 0.0, 0.076_430_745_793_885_56,
        0.225_532_134_332_614_6, 0.245_411_934_083_000_88, 0.004_554_711_900_830_169_5, 0.010_565_742_759_480_532,
        0.068_375_693_870_410_16, 0.0, 0.001_548_203_084_876_903_6, 0.008_101_869_109_825_365,
    ],
    [
        0.180_973_637_717_354_06, 0.188_680_820_381_930_2, 0.076_430_745_793_858_82, 0.0,
        0.235_678_837_488_154_6, 0.249_326_515_426_778_2, 0.002_745_298_290_364_942_3, 0.006_966_618_614_668_301,
        0.0, 0.053_103_750_499_359_64, 0.000_913_669_017_578_208_7, 0.005_180_106_766_085_296,
    ],
    [
        0.162_931_775_257_882_55, 0.179_616_251_420_870_76, 0.135_319_280_624_355_33, 0.141_407_302_504_746_92,
        0.0, 0.231_541_074_754_988_42, 0.012_401_432_442_141_869, 0.020_676_282_341_705_27,
        0.013_841_729_382_214_571, 0.016_719_494_245_015_905, 0.085_545_377_050_275_07, 0.0,
    ],
    [
        0.182_881_213_161_811_77, 0.190_057_264_033_893_67, 0.147_247_160_441_725_73, 0.149_595_909_256_254_38,
        0.231_541_074_759_123_75, 0.0, 0.004_853_472_324_439_478, 0.010_816_892_877_954_218,
        0.006_360_109_084_366_722, 0.008_799_556_883_362_845, 0.0, 0.067_847_347_177_176_7,
    ],
    [
        0.759_612_101_318_906_6, 0.0, 0.030_364_746_005_534_463, 0.018_301_988_602_432_95,
        0.137_793_693_801_576_33, 0.053_927_470_271_549_76, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ],
    [
        0.0, 0.533_193_421_731_680_3, 0.070_438_285_063_203_56, 0.046_444_124_097_788_676,
        0.229_736_470_463_391_88, 0.120_187_698_643_935_76, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ],
    [
        0.102_608_609_688_036_38, 0.047_012_851_578_250_046, 0.569_797_448_920_084_5, 0.0,
        0.192_246_241_419_646_8, 0.088_334_848_393_982_23, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ],
    [
        0.134_392_568_962_468_4, 0.068_644_911_204_274_39, 0.0, 0.442_531_254_161_330_27,
        0.232_215_197_847_443_1, 0.122_216_067_824_483_94, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ],
    [
        0.023_857_737_608_116_603, 0.009_225_592_261_348_557, 0.010_321_353_899_179_356, 0.006_091_126_783_854_724,
        0.950_504_189_447_500_7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ],
    [
        0.106_824_967_444_254_43, 0.050_769_113_636_600_05, 0.054_012_460_732_169_094, 0.034_534_045_107_235_3,
        0.0, 0.753_859_413_079_741_1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ],
];

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::scene::FaceId;

    fn check(name: &str, row_sums_are_one: bool) {
        let scene = builtin::build(name, None).unwrap().scene;
        let known = surface_form_factors(&scene).unwrap();
        let n = scene.surfaces.len();
        let area = |k: usize| scene.area_vector(FaceId(u32::try_from(k).unwrap())).length();
        for i in 0..n {
            for j in 0..n {
                let difference = area(i) * known.values[i * n + j] - area(j) * known.values[j * n + i];
                assert!(
                    difference.abs() <= 2.0 * known.error * area(i).max(area(j)),
                    "{name}: {i}, {j}"
                );
            }
            let sum: f64 = known.values[i * n..(i + 1) * n].iter().sum();
            assert!(
                !row_sums_are_one || (sum - 1.0).abs() < known.error,
                "{name}: row {i} sums to {sum}"
            );
        }
    }

    #[test]
    fn the_numbers_obey_the_laws() {
        check("corridor", false);
        check("room-box", true);
    }

    #[test]
    fn materials_do_not_matter_and_geometry_does() {
        let mut scene = builtin::build("corridor", None).unwrap().scene;
        for material in &mut scene.materials {
            material.reflectance = [0.1; 3];
        }
        assert!(surface_form_factors(&scene).is_some());
        scene.vertices[0].x -= 1e-9;
        assert!(surface_form_factors(&scene).is_none());
        assert!(surface_form_factors(&builtin::build("cube", None).unwrap().scene).is_none());
    }
}
