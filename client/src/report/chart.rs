//! The error of a frame over its time, both on logarithmic scales, as SVG.

use std::f64::consts::LN_10;
use std::fmt::Write as _;

use karst_core::math::ln;

use super::RoundFigures;
use crate::progress::percent;

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 260.0;
/// Space for labels: left, top, right, bottom.
const MARGIN: [f64; 4] = [64.0, 14.0, 18.0, 40.0];

/// A logarithmic scale: numbers from `low` to `high` onto `from` to `to`.
struct Scale {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// A scale with room around all numbers.
    fn around(numbers: impl Iterator<Item = f64> + Clone, from: f64, to: f64) -> Self {
        let low = numbers.clone().fold(f64::INFINITY, f64::min) / 1.3;
        let high = numbers.fold(0.0, f64::max) * 1.3;
        Self { low, high: high.max(low * 2.0), from, to }
    }

    fn at(&self, value: f64) -> f64 {
        self.from + (self.to - self.from) * log10(value / self.low) / log10(self.high / self.low)
    }

    /// Round numbers on the scale: powers of ten, and as many between them as there is room for.
    fn ticks(&self) -> Vec<f64> {
        let decades = log10(self.high / self.low);
        let steps: &[f64] = match decades {
            d if d > 2.5 => &[1.0],
            d if d > 1.0 => &[1.0, 2.0, 5.0],
            _ => &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0],
        };
        let first = log10(self.low).floor() as i32;
        let last = log10(self.high).ceil() as i32;
        (first..=last)
            .flat_map(|power| steps.iter().map(move |step| step * 10_f64.powi(power)))
            .filter(|tick| (self.low..=self.high).contains(tick))
            .collect()
    }
}

/// The curve with a dot for each round, the interval of the last one, the target if there is one, and the slope that
/// independent samples have. Nothing where no error is known.
pub(super) fn convergence(
    rounds: &[RoundFigures],
    interval: Option<[f64; 2]>,
    target: Option<f64>,
) -> String {
    let dots: Vec<(f64, f64, &RoundFigures)> = rounds
        .iter()
        .filter_map(|round| Some((round.seconds, round.rel_mse?.sqrt(), round)))
        .filter(|(seconds, error, _)| *seconds > 0.0 && *error > 0.0)
        .collect();
    let Some(&(last_seconds, last_error, _)) = dots.last() else {
        return String::new();
    };
    // Down to 0 there is no way on this scale: a tenth of the error stands for it.
    let interval = interval.map(|ends| ends.map(|end| end.max(0.0).sqrt().max(0.1 * last_error)));
    let errors = dots.iter().map(|dot| dot.1).chain(interval.into_iter().flatten()).chain(target);
    let x = Scale::around(dots.iter().map(|dot| dot.0), MARGIN[0], WIDTH - MARGIN[2]);
    let y = Scale::around(errors, HEIGHT - MARGIN[3], MARGIN[1]);
    let mut svg = format!(r#"<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="error over time">"#);
    axes(&mut svg, &x, &y);
    if let Some(target) = target {
        let at = y.at(target);
        let _ = write!(
            svg,
            r#"<path class="target" d="M{} {at:.1}H{}"/><text x="{}" y="{:.1}">target {}</text>"#,
            x.from,
            x.to,
            x.from + 6.0,
            at - 5.0,
            percent(target)
        );
    }
    // Through the last dot: half the error takes four times the time.
    let clip = |seconds: f64| (x.at(seconds), y.at(last_error * (last_seconds / seconds).sqrt()));
    let start = x.low.max(last_seconds * (last_error / y.high) * (last_error / y.high));
    let (from, to) =
        (clip(start), clip(x.high.min(last_seconds * (last_error / y.low) * (last_error / y.low))));
    let _ = write!(svg, r#"<path class="slope" d="M{:.1} {:.1}L{:.1} {:.1}"/>"#, from.0, from.1, to.0, to.1);
    if let Some([low, high]) = interval {
        let _ = write!(
            svg,
            r#"<path class="curve" d="M{:.1} {:.1}V{:.1}"/>"#,
            x.at(last_seconds),
            y.at(low),
            y.at(high)
        );
    }
    let line: Vec<String> = dots.iter().map(|d| format!("{:.1} {:.1}", x.at(d.0), y.at(d.1))).collect();
    let _ = write!(svg, r#"<path class="curve" d="M{}"/>"#, line.join("L"));
    for (seconds, error, round) in &dots {
        let _ = write!(
            svg,
            r#"<circle cx="{:.1}" cy="{:.1}" r="4"><title>{:.1} samples per pixel, {}, {seconds:.2} s</title></circle>"#,
            x.at(*seconds),
            y.at(*error),
            round.spp_mean,
            percent(*error)
        );
    }
    svg.push_str("</svg>");
    svg
}

fn axes(svg: &mut String, x: &Scale, y: &Scale) {
    for tick in x.ticks() {
        let at = x.at(tick);
        let _ = write!(
            svg,
            r#"<path class="grid" d="M{at:.1} {}V{}"/><text x="{at:.1}" y="{}" class="middle">{}</text>"#,
            y.to,
            y.from,
            y.from + 16.0,
            short(tick)
        );
    }
    for tick in y.ticks() {
        let at = y.at(tick);
        let _ = write!(
            svg,
            r#"<path class="grid" d="M{} {at:.1}H{}"/><text x="{}" y="{:.1}" class="end">{} %</text>"#,
            x.from,
            x.to,
            x.from - 6.0,
            at + 4.0,
            short(tick * 100.0)
        );
    }
    let _ = write!(
        svg,
        r#"<text x="{}" y="{}" class="middle">seconds of rendering</text>"#,
        0.5 * (x.from + x.to),
        HEIGHT - 4.0
    );
}

/// Precise enough for a drawing.
fn log10(value: f64) -> f64 {
    f64::from(ln(value as f32)) / LN_10
}

/// A round number without zeros that say nothing.
fn short(value: f64) -> String {
    let exact = |text: &String| text.parse::<f64>().is_ok_and(|read| (read - value).abs() <= 1e-6 * value);
    (0..9).map(|digits| format!("{value:.digits$}")).find(exact).unwrap_or_else(|| format!("{value:e}"))
}

#[cfg(test)]
mod tests {
    use super::{Scale, convergence, short};
    use crate::report::RoundFigures;

    fn rounds() -> Vec<RoundFigures> {
        (0..4)
            .map(|round| RoundFigures {
                round,
                seconds: 0.1 * f64::from(4_u32.pow(round)),
                samples: 0,
                spp_mean: f64::from(2 * 4_u32.pow(round)),
                rel_mse: (round > 0).then(|| 0.1 / f64::from(4_u32.pow(round))),
            })
            .collect()
    }

    #[test]
    fn dots_stand_where_the_error_is_known() {
        let svg = convergence(&rounds(), Some([0.001, 0.002]), Some(0.05));
        assert_eq!(svg.matches("<circle").count(), 3);
        assert!(svg.contains("target 5.00 %") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        // An interval from 0 does not press everything else flat.
        let svg = convergence(&rounds(), Some([0.0, 0.002]), None);
        assert!(svg.contains(">1 %<") && !svg.contains(">0.1 %<"), "{svg}");
        assert_eq!(convergence(&rounds()[..1], None, None), "");
    }

    #[test]
    fn scales_are_logarithmic_and_their_ticks_are_round() {
        let scale = Scale { low: 0.09, high: 11.0, from: 0.0, to: 100.0 };
        assert!((scale.at(0.99) - 0.5 * (scale.at(0.33) + scale.at(2.97))).abs() < 1e-9);
        let ticks: Vec<String> = scale.ticks().into_iter().map(short).collect();
        assert_eq!(ticks, ["0.1", "0.2", "0.5", "1", "2", "5", "10"]);
        let few = Scale { low: 1.2, high: 4.0, from: 0.0, to: 100.0 };
        assert_eq!(few.ticks().into_iter().map(short).collect::<Vec<_>>(), ["1.5", "2", "3"]);
    }
}
