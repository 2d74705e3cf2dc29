//! The report as one page of HTML that needs nothing else: pictures, maps, the curve and tables.

use std::fmt::Write as _;
use std::ops::Add;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use karst_client::Error;
use karst_core::color::View;
use karst_core::encode::{false_color, heat_map, png_rgb8, rgb8};
use karst_core::film::Picture;
use karst_core::math::powf;

use super::Report;
use super::chart::convergence;
use crate::progress::percent;

/// Frames that are shown with pictures, those with the largest error; all others have a row of the table.
const SHOWN: usize = 8;

/// Pictures wider than this are made smaller.
const WIDEST: u32 = 640;

/// One frame with its pictures, as 8-bit PNG.
#[derive(Debug)]
struct Plate {
    report: Report,
    target: Option<f64>,
    picture: String,
    error: Map,
    samples: Map,
}

/// A map in false colours.
#[derive(Debug)]
struct Map {
    image: String,
    low: f32,
    high: f32,
}

/// What the page is made of, gathered frame by frame.
#[derive(Debug, Default)]
pub(crate) struct Page {
    rows: Vec<Report>,
    plates: Vec<Plate>,
}

/// A finished frame as the page wants it.
pub(crate) struct Finished<'a> {
    pub(crate) report: &'a Report,
    /// The error that was asked for.
    pub(crate) target: Option<f64>,
    pub(crate) picture: &'a Picture,
    /// In stops.
    pub(crate) exposure: f32,
    pub(crate) view: View,
}

impl Page {
    /// Adds a frame.
    ///
    /// # Errors
    /// Its pictures cannot be encoded.
    pub(crate) fn add(&mut self, frame: &Finished<'_>) -> Result<(), Error> {
        self.rows.push(frame.report.clone());
        self.plates.push(plate(frame)?);
        if self.plates.len() > SHOWN {
            self.plates
                .sort_by(|a, b| b.report.rel_mse.unwrap_or(0.0).total_cmp(&a.report.rel_mse.unwrap_or(0.0)));
            self.plates.truncate(SHOWN);
        }
        Ok(())
    }

    /// The page; `title` is the scene's name.
    pub(crate) fn html(&self, title: &str) -> String {
        let title = escape(title);
        let mut html = format!(
            "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" \
             content=\"width=device-width\"><title>{title}: report</title><style>{STYLE}</style>\n<h1>{title}</h1>\n"
        );
        if self.rows.len() > 1 {
            html.push_str(&frames(&self.rows, self.plates.len()));
        }
        let mut plates: Vec<&Plate> = self.plates.iter().collect();
        plates.sort_by_key(|plate| plate.report.frame);
        for plate in plates {
            section(&mut html, plate, self.rows.len() > 1);
        }
        html
    }
}

fn plate(frame: &Finished<'_>) -> Result<Plate, Error> {
    let Picture { window, color, error, samples, .. } = frame.picture;
    let (width, height) = (window.width(), window.height());
    let step = width.div_ceil(WIDEST).max(1);
    let gain = powf(2.0, frame.exposure);
    let light = shrunk(color, (width, height), step, |sum, count| sum * (gain / count));
    let size = (width.div_ceil(step), height.div_ceil(step));
    let of = |values: &[f32]| shrunk(values, (width, height), step, |sum, count| sum / count);
    Ok(Plate {
        report: frame.report.clone(),
        target: frame.target,
        picture: data_url(&rgb8(&light, frame.view), size)?,
        error: map(&of(error), size)?,
        samples: map(&of(samples), size)?,
    })
}

/// Means of squares of `step` pixels.
fn shrunk<T: Copy + Default + Add<Output = T>>(
    values: &[T],
    (width, height): (u32, u32),
    step: u32,
    mean: impl Fn(T, f32) -> T,
) -> Vec<T> {
    let cell = |x: u32, y: u32| {
        let (x1, y1) = ((x + step).min(width), (y + step).min(height));
        let places = (y..y1).flat_map(|row| (x..x1).map(move |column| (row * width + column) as usize));
        mean(places.fold(T::default(), |sum, place| sum + values[place]), ((x1 - x) * (y1 - y)) as f32)
    };
    let step_by = step as usize;
    (0..height)
        .step_by(step_by)
        .flat_map(|y| (0..width).step_by(step_by).map(move |x| (x, y)))
        .map(|(x, y)| cell(x, y))
        .collect()
}

/// Values in false colours, from their 1st to their 99th percentile.
fn map(values: &[f32], size: (u32, u32)) -> Result<Map, Error> {
    let mut known: Vec<f32> =
        values.iter().copied().filter(|value| value.is_finite() && *value > 0.0).collect();
    known.sort_by(f32::total_cmp);
    let at = |share: usize| known.get((known.len() * share / 100).min(known.len().saturating_sub(1)));
    let (low, high) = (at(1).copied().unwrap_or(1.0), at(99).copied().unwrap_or(1.0));
    // A map of one value is one colour.
    let high = high.max(low * 1.001);
    Ok(Map { image: data_url(&heat_map(values, low, high), size)?, low, high })
}

fn data_url(pixels: &[[u8; 3]], (width, height): (u32, u32)) -> Result<String, Error> {
    let bytes =
        png_rgb8(pixels, width, height).map_err(|error| Error::Failed(format!("the report: {error}")))?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(bytes)))
}

/// One row a frame.
fn frames(rows: &[Report], shown: usize) -> String {
    let mut html =
        String::from("<table><tr><th>frame<th>samples per pixel<th>error<th>seconds<th>Msamples/s");
    for row in rows {
        let _ = write!(
            html,
            "<tr><td>{}<td>{:.1}<td>{}<td>{:.2}<td>{:.2}",
            row.frame,
            row.spp_mean,
            error_of(row),
            row.render_seconds,
            row.msamples_per_second
        );
    }
    html.push_str("</table>\n");
    if shown < rows.len() {
        let _ = writeln!(html, "<p>The {shown} frames with the largest error:</p>");
    }
    html
}

fn section(html: &mut String, plate: &Plate, is_one_of_many: bool) {
    let report = &plate.report;
    if is_one_of_many {
        let _ = writeln!(html, "<h2>Frame {}</h2>", report.frame);
    }
    let _ = writeln!(html, "<figure><img src=\"{}\" alt=\"the picture\"></figure>", plate.picture);
    html.push_str("<div class=\"pair\">");
    let scale = |low: String, high: String| {
        let stops: Vec<String> = (0..=8)
            .map(|stop| {
                let [r, g, b] = false_color(stop as f32 / 8.0);
                format!("rgb({r} {g} {b})")
            })
            .collect();
        format!(
            "<span class=\"bar\">{low}<i style=\"background:linear-gradient(to right,{})\"></i>{high}</span>",
            stops.join(",")
        )
    };
    let maps = [
        ("Estimated error of each block", &plate.error, scale(rate(plate.error.low), rate(plate.error.high))),
        ("Samples per pixel", &plate.samples, scale(count(plate.samples.low), count(plate.samples.high))),
    ];
    for (name, map, scale) in maps {
        let _ = write!(
            html,
            "<figure><img src=\"{}\" alt=\"{name}\"><figcaption>{name}{scale}</figcaption></figure>",
            map.image
        );
    }
    html.push_str("</div>\n");
    let curve = convergence(&report.rounds, report.rel_mse_ci95, plate.target);
    if !curve.is_empty() {
        let _ = writeln!(
            html,
            "<figure>{curve}<figcaption>Error after each round, with its 95 % interval at the end; dashed: what independent \
             samples would go along.</figcaption></figure>"
        );
    }
    html.push_str("<div class=\"pair\">");
    html.push_str(&figures(report));
    html.push_str(&stages(report));
    html.push_str("</div>\n");
}

/// The table of figures.
fn figures(report: &Report) -> String {
    let rows = [
        ("error (root of relMSE)", error_of(report)),
        ("error of the denoised picture", in_interval(report.denoised_rel_mse, report.denoised_rel_mse_ci95)),
        (
            "root of mean squared error",
            report.rmse.map_or_else(|| "unknown".to_owned(), |rmse| format!("{rmse:.3e}")),
        ),
        ("samples per pixel", format!("{:.1} ({} to {})", report.spp_mean, report.spp_min, report.spp_max)),
        ("pixels", format!("{} × {}", report.width, report.height)),
        ("seconds of rendering", format!("{:.2} on {} threads", report.render_seconds, report.threads)),
        ("million samples per second", format!("{:.2}", report.msamples_per_second)),
        ("million rays per second", format!("{:.2}", report.mrays_per_second)),
        ("rays, of these to lights", format!("{}, {}", grouped(report.rays), grouped(report.shadow_rays))),
        ("evaluations of distance functions", grouped(report.sdf_evaluations)),
        ("samples that were not finite, dropped", grouped(report.nonfinite_samples)),
        ("rays that ran out of steps", grouped(report.exhausted_rays)),
        ("most memory", format!("{:.0} MiB", report.peak_rss_bytes as f64 / 1_048_576.0)),
    ];
    let rows: Vec<String> = rows.iter().map(|(name, value)| format!("<tr><th>{name}<td>{value}")).collect();
    format!("<table>{}</table>", rows.concat())
}

/// The table of the stages' times.
fn stages(report: &Report) -> String {
    let seconds = |value: &serde_json::Value| value.as_f64().unwrap_or(0.0);
    let total: f64 = report.profile.values().map(seconds).sum();
    let rows: Vec<String> = report
        .profile
        .iter()
        .map(|(name, value)| {
            let share = 100.0 * seconds(value) / total.max(f64::MIN_POSITIVE);
            format!("<tr><th>{name}<td>{:.2} s<td>{share:.1} %<td class=\"share\"><i style=\"width:{share:.1}%\"></i>", seconds(value))
        })
        .collect();
    format!("<table><tr><th colspan=\"4\">time by stage, all threads together{}</table>", rows.concat())
}

fn error_of(report: &Report) -> String {
    in_interval(report.rel_mse, report.rel_mse_ci95)
}

/// The root of an error with its interval.
fn in_interval(rel_mse: Option<f64>, ci95: Option<[f64; 2]>) -> String {
    let Some(error) = rel_mse else { return "unknown".to_owned() };
    let interval = ci95.map_or_else(String::new, |[low, high]| {
        format!(" ({} to {})", percent(low.max(0.0).sqrt()), percent(high.sqrt()))
    });
    format!("{}{interval}", percent(error.sqrt()))
}

fn rate(error: f32) -> String {
    percent(f64::from(error))
}

fn count(samples: f32) -> String {
    format!("{samples:.0}")
}

/// A number with its thousands apart.
fn grouped(number: u64) -> String {
    indicatif::HumanCount(number).to_string()
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

const STYLE: &str = "\
:root{color-scheme:light dark}\
body{font:15px/1.45 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem}\
h1,h2{font-weight:600;margin:1.5rem 0 .75rem}\
figure{margin:0 0 1.5rem}img{display:block;width:100%;height:auto}\
figcaption{font-size:.85rem;opacity:.8;margin-top:.4rem;display:flex;justify-content:space-between;gap:1rem;flex-wrap:wrap}\
.pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(20rem,1fr));gap:1.5rem;align-items:start}\
.bar{display:inline-flex;gap:.4rem;align-items:center}.bar i{width:7rem;height:.7rem}\
table{border-collapse:collapse;font-size:.9rem;font-variant-numeric:tabular-nums;margin-bottom:1.5rem;width:100%}\
th{text-align:left;font-weight:400;opacity:.8}td{text-align:right;white-space:nowrap}th,td{padding:.2rem .5rem;border-bottom:1px solid #8884}\
.share{width:30%}.share i{display:block;height:.6rem;background:#d9622b}\
svg{width:100%;height:auto;font-size:12px;fill:currentColor}\
.grid{stroke:#8884}.curve{stroke:#d9622b;stroke-width:2;fill:none}circle{fill:#d9622b}\
.slope{stroke:currentColor;stroke-dasharray:3 5;opacity:.5}.target{stroke:#3a86c8;stroke-width:1.5}\
.middle{text-anchor:middle}.end{text-anchor:end}";

#[cfg(test)]
mod tests {
    use super::{escape, shrunk};

    #[test]
    fn pictures_are_made_smaller_by_means() {
        let values: Vec<f32> = (0..15).map(|value| value as f32).collect();
        let mean = |sum: f32, count: f32| sum / count;
        assert_eq!(shrunk(&values, (5, 3), 1, mean), values);
        // Rows of 0 to 4, 5 to 9, 10 to 14; what is left at the edges counts by itself.
        assert_eq!(shrunk(&values, (5, 3), 2, mean), [3.0, 5.0, 6.5, 10.5, 12.5, 14.0]);
    }

    #[test]
    fn names_are_text_and_never_markup() {
        assert_eq!(escape("<a & \"b\">"), "&lt;a &amp; &quot;b&quot;&gt;");
    }
}
