//! Owns the substances that scenes call by name: indices of refraction of what is clear, and of metals.

/// Indices of refraction at about 589 nm (Hecht, Optics, 4th edition, and data sheets), as Mitsuba names them.
const CLEAR: [(&str, f64); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

/// The index of refraction of a clear substance; `Err` lists what is known.
pub(super) fn clear(name: &str) -> Result<f64, String> {
    let wanted = name.trim().to_ascii_lowercase().replace(['-', '_'], " ");
    CLEAR.iter().find(|(known, _)| *known == wanted).map(|(_, index)| *index).ok_or_else(|| {
        let known: Vec<&str> = CLEAR.iter().map(|(known, _)| *known).collect();
        format!("found the substance {name:?}, expected a number or one of {}", known.join(", "))
    })
}

/// A metal: refraction and absorption by colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Metal {
    pub(super) eta: [f64; 3],
    pub(super) k: [f64; 3],
}

/// Refraction and absorption in linear Rec.709, from the spectra that Mitsuba carries (measured, collected at
/// luxpop.com and in Palik's Handbook of Optical Constants), integrated against the standard observer.
#[rustfmt::skip]
const METALS: [(&str, [f64; 3], [f64; 3]); 27] = [
    ("Ag", [0.155_264_648_9, 0.116_723_296_5, 0.138_380_695_9], [4.828_343_322_4, 3.122_245_927_8, 2.146_950_445_5]),
    ("Al", [1.657_459_959_5, 0.880_368_957_9, 0.521_228_734_6], [9.223_869_199_6, 6.269_523_247_7, 4.837_001_228_1]),
    ("Au", [0.143_118_955_7, 0.374_957_043_2, 1.442_478_557_1], [3.983_160_424_7, 2.385_720_747_8, 1.603_215_289_9]),
    ("Be", [4.185_059_278_8, 3.185_060_442_3, 2.784_091_345_7], [3.835_439_826_8, 3.010_126_016_2, 2.869_008_874_3]),
    ("Cr", [4.369_682_866_3, 2.916_702_489_2, 1.654_700_541_3], [5.206_433_795_6, 4.231_364_527_7, 3.754_946_793_3]),
    ("Cu", [0.200_437_697_0, 0.924_033_430_4, 1.102_211_952_7], [3.912_948_503_3, 2.452_847_701_5, 2.142_187_955_2]),
    ("Cu2O", [3.549_283_375_5, 2.952_062_244_9, 2.736_920_213_7], [0.113_217_929_4, 0.194_665_967_0, 0.600_168_126_4]),
    ("CuO", [3.245_382_220_4, 2.449_629_396_5, 2.197_411_449_3], [0.520_273_962_1, 0.570_737_275_6, 0.717_225_061_3]),
    ("Hg", [2.398_931_490_4, 1.440_025_491_7, 0.909_551_209_0], [6.327_626_944_4, 4.371_941_415_2, 3.421_789_927_0]),
    ("HgTe", [4.779_526_775_2, 3.230_998_458_1, 2.660_025_240_1], [1.631_982_705_8, 1.580_818_933_9, 1.729_575_385_2]),
    ("Ir", [3.086_409_839_4, 2.082_193_844_0, 1.617_886_680_5], [5.592_151_007_7, 4.067_175_715_0, 3.267_261_126_9]),
    ("K", [0.064_049_307_0, 0.046_410_062_1, 0.038_184_201_7], [2.104_215_592_0, 1.348_936_435_7, 0.913_211_388_9]),
    ("Li", [0.265_787_194_2, 0.195_610_243_2, 0.220_919_853_8], [3.540_174_340_7, 2.311_130_654_2, 1.668_593_000_0]),
    ("Mo", [4.483_701_028_0, 3.525_457_825_5, 2.776_076_943_8], [4.111_130_798_8, 3.420_871_625_2, 3.150_603_140_4]),
    ("Na", [0.060_266_532_0, 0.056_141_243_5, 0.061_990_949_4], [3.179_290_649_6, 2.112_480_078_1, 1.579_094_026_6]),
    ("Nb", [3.420_135_359_5, 2.790_192_137_9, 2.395_585_665_8], [3.441_381_790_0, 2.737_643_793_0, 2.579_913_270_8]),
    ("Ni", [2.367_275_352_1, 1.663_358_330_2, 1.467_055_417_2], [4.498_832_991_1, 3.050_164_395_7, 2.345_427_439_9]),
    ("Rh", [2.585_795_493_3, 1.860_186_606_8, 1.554_427_952_4], [6.782_292_711_0, 4.702_950_102_6, 3.976_089_246_1]),
    ("Se", [4.059_261_108_5, 2.842_694_738_0, 2.820_758_283_5], [0.754_379_175_0, 0.638_515_055_8, 0.521_587_202_9]),
    ("Ta", [2.062_584_660_7, 2.393_091_556_9, 2.628_068_494_8], [2.408_046_797_3, 1.741_370_586_4, 1.947_037_701_6]),
    ("Te", [7.390_839_608_8, 4.482_102_898_5, 2.637_070_847_8], [3.256_141_289_2, 3.527_390_813_3, 3.292_168_311_6]),
    ("TiC", [3.700_467_376_2, 2.837_435_650_9, 2.582_303_027_8], [3.265_690_581_8, 2.351_558_638_8, 2.172_785_780_0]),
    ("TiN", [1.648_469_160_7, 1.150_448_252_2, 1.379_779_509_7], [3.368_459_622_6, 1.943_488_854_0, 1.102_012_334_7]),
    ("V", [4.277_512_621_8, 3.513_153_823_6, 2.761_125_746_1], [3.491_184_450_4, 2.889_358_087_4, 3.111_696_511_7]),
    ("VC", [3.657_566_599_1, 2.752_729_806_5, 2.532_681_457_0], [3.068_351_665_9, 2.198_668_771_3, 1.963_181_625_2]),
    ("VN", [2.865_601_158_8, 2.119_181_779_1, 1.940_076_714_9], [3.032_326_495_0, 2.056_107_558_0, 1.616_293_091_4]),
    ("W", [4.370_702_992_4, 3.300_297_244_5, 2.998_266_652_8], [3.500_677_859_1, 2.604_865_278_1, 2.273_193_061_4]),
];

/// A metal by its formula; `None` is a perfect mirror. `Err` lists what is known.
pub(super) fn metal(name: &str) -> Result<Option<Metal>, String> {
    let wanted = name.trim();
    if wanted.eq_ignore_ascii_case("none") {
        return Ok(None);
    }
    // The same substances from other tables.
    let wanted = wanted.strip_suffix("_palik").unwrap_or(wanted);
    let found = METALS.iter().find(|(known, ..)| known.eq_ignore_ascii_case(wanted));
    found.map(|&(_, eta, k)| Some(Metal { eta, k })).ok_or_else(|| {
        let known: Vec<&str> = METALS.iter().map(|(known, ..)| *known).collect();
        format!("found the metal {name:?}, known are none, {}", known.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::{METALS, clear, metal};

    #[test]
    fn substances_are_found_by_name() {
        assert_eq!(clear("bk7"), Ok(1.5046));
        assert_eq!(clear("Water-Ice"), Ok(1.31));
        assert!(clear("glas").unwrap_err().contains("diamond"));
        assert_eq!(metal("none"), Ok(None));
        assert_eq!(metal("Cu").unwrap().unwrap().eta[0], 0.200_437_697);
        assert!(metal("Xx").unwrap_err().contains("Au"));
    }

    #[test]
    fn metals_reflect_as_they_look() {
        let reflectance = |name: &str| {
            let metal = metal(name).unwrap().unwrap();
            [0, 1, 2].map(|c| {
                let (eta, k) = (metal.eta[c], metal.k[c]);
                ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k)
            })
        };
        for (name, ..) in METALS {
            assert!(reflectance(name).iter().all(|r| *r > 0.1 && *r < 1.0), "{name}");
        }
        let [gold, silver] = ["Au", "Ag"].map(reflectance);
        assert!(gold[0] > 0.9 && gold[2] < 0.5, "{gold:?}");
        assert!(silver.iter().all(|r| *r > 0.85), "{silver:?}");
    }
}
