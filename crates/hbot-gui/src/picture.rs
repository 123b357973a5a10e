//! A picture that the window takes of itself, for the documentation and for tests.

use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use eframe::egui::{self, ColorImage};

/// A plan to save a picture of the window as a PNG file at a given time.
#[derive(Debug)]
pub struct Picture {
    path: PathBuf,
    after: Duration,
    /// `None` before the first frame.
    due: Option<Instant>,
    /// Receives the picture some frames after it was requested. `None` before the request.
    asked: Option<std::sync::mpsc::Receiver<std::sync::Arc<ColorImage>>>,
}

impl Picture {
    /// Creates a plan to save a picture of the window to the PNG file `path`, when the time `after`
    /// has passed since the first frame.
    #[must_use]
    pub fn new(path: PathBuf, after: Duration) -> Self {
        Self { path, after, due: None, asked: None }
    }

    /// Takes and saves the picture when its time has come. Call this once per frame. Returns `None`
    /// until the picture has been saved or saving has failed, then the result.
    pub fn frame(&mut self, ctx: &egui::Context) -> Option<anyhow::Result<()>> {
        let now = Instant::now();
        let due = *self.due.get_or_insert(now + self.after);
        if now < due {
            ctx.request_repaint_after(due - now);
            return None;
        }
        ctx.request_repaint();
        let Some(answer) = &self.asked else {
            let (sender, receiver) = std::sync::mpsc::channel();
            // Sending fails only if the picture is no longer wanted.
            ctx.request_screenshot(move |image| drop(sender.send(image)));
            self.asked = Some(receiver);
            return None;
        };
        let image = answer.try_recv().ok()?;
        Some(write(&self.path, &image))
    }
}

fn write(path: &Path, image: &ColorImage) -> anyhow::Result<()> {
    let [width, height] = image.size;
    let file = std::fs::File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let rgb: Vec<u8> = image.pixels.iter().flat_map(|pixel| pixel.to_array()[..3].to_vec()).collect();
    encoder.write_header()?.write_image_data(&rgb)?;
    Ok(())
}
