//! `pdk report`: a page about a run.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use image::codecs::jpeg::JpegEncoder;
use pdk_chain::moment::Moment;
use pdk_chain::view::View;
use pdk_components::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_preview::method;
use pdk_preview::picture;
use pdk_record::directory::REPORT;
use pdk_report::Run;
use pdk_report::record::{self, Read};
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Place, Result};
use serde_json::json;

use super::{Global, print_json};

/// That of the frames in traces.
const JPEG_QUALITY: u8 = 85;

/// The page about several records, in the folder of the first.
const COMPARISON: &str = "comparison.html";

/// Arguments of `pdk report`
#[derive(clap::Args)]
pub struct Arguments {
    /// The folder of the record; several are compared on one page
    #[arg(value_name = "RUN", required = true)]
    record: Vec<PathBuf>,
    /// Where to write the page [default: RUN/report.html, of several records comparison.html in the first]
    #[arg(short, long, alias = "output", value_name = "FILE.html")]
    out: Option<PathBuf>,
    /// Show beside the frames of failures what the driver's network looked at, by this saliency method [default: the one that `pdk list saliency` marks as the default]
    #[arg(long, value_name = "NAME[,PARAMETER=VALUE]...", num_args = 0..=1, require_equals = true,
          default_missing_value = "")]
    saliency: Option<String>,
    /// Show it in the browser
    #[arg(long)]
    open: bool,
}

/// Writes the page and says where it is.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let named = |record: &PathBuf| record.join(if arguments.record.len() > 1 { COMPARISON } else { REPORT });
    let page = arguments.out.clone().or_else(|| arguments.record.first().map(named)).unwrap_or_default();
    let Read { mut run, mut warnings } = record::read_all(&arguments.record, &page)?;
    if let Some(method) = &arguments.saliency {
        let registry = global.registry()?;
        let method = method::named(registry.catalog(), method)?;
        warnings.extend(add_attention(&registry, &mut run, &method)?);
    }
    for warning in &warnings {
        eprintln!("pdk: warning: {warning}");
    }
    let text = pdk_report::render(&run)?;
    pdk_sdk::file::write(&page, text.as_bytes()).map_err(|error| {
        Error::new(format!("cannot write {} ({error}); name another place with --out", page.display()))
    })?;
    if global.json {
        print_json(&json!({
            "output": page, "scenarios": record::scenarios(&run), "evaluations": run.evaluations.len(),
            "unfinished": run.unfinished.is_some(),
        }))?;
    } else {
        println!("Report: {}", page.display());
    }
    if arguments.open
        && let Err(error) = open(&page)
    {
        // The page is there all the same.
        eprintln!("pdk: warning: {error}");
    }
    Ok(())
}

impl Arguments {
    /// Whether components are called for it.
    pub fn calls_components(&self) -> bool {
        self.saliency.is_some()
    }
}

/// Lays over the frames of failures what the driver's network looked at. Drivers that are not networks are left out, and said.
fn add_attention(registry: &Registry, run: &mut Run, method: &ComponentSpec) -> Result<Vec<String>> {
    // An unknown method is the user's mistake. A driver without a network is not.
    registry.catalog().get(Kind::Saliency, &method.name)?;
    let mut left_out = Vec::new();
    for drive in &mut run.drives {
        let Some(driver) = &drive.driver_spec else { continue };
        let by = match method::of_driver(registry.catalog(), driver, method) {
            Ok(by) => by,
            Err(error) => {
                left_out.push(format!("there are no heat maps of `{}`: {error}", drive.driver));
                continue;
            }
        };
        let mut view = View::new(registry, &by, run.setup.seed)?;
        for shot in drive.scenarios.iter_mut().flat_map(|scenario| &mut scenario.shots) {
            if shot.perturbed.is_empty() || !shot.attention.is_empty() {
                continue;
            }
            let frame = picture::to_frame(pdk_image::decode(&shot.perturbed)?.to_rgb8())?;
            let shown = view.picture(frame.as_ref(), &Moment::new(0, shot.time).alone())?;
            let encoder = JpegEncoder::new_with_quality(&mut shot.attention, JPEG_QUALITY);
            picture::to_image(&shown).write_with_encoder(encoder).place("cannot encode a heat map")?;
        }
    }
    Ok(left_out)
}

/// Hands the page to the program that the system shows such files with.
pub fn open(page: &Path) -> Result<()> {
    let program = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };
    let quiet = || Stdio::null();
    let ended = Command::new(program).arg(page).stdin(quiet()).stdout(quiet()).stderr(quiet()).status();
    match ended {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(Error::new(format!(
            "`{program}` did not open {} ({status}); open it in a browser yourself",
            page.display()
        ))),
        Err(error) => Err(Error::new(format!(
            "cannot start `{program}` ({error}); open {} in a browser yourself",
            page.display()
        ))),
    }
}
