//! Colours, each with one meaning, and small widgets that look alike in the whole window.

use eframe::egui::{self, Color32, Response, RichText, Ui};
use hbot_api::Mode;

use crate::model::{Headline, Weight};

/// The colours of the window, named by what they mean.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Palette {
    /// Colours of the axes 1, 2 and 3, for frame N and for the axes of the sphere.
    pub(crate) axes: [Color32; 3],
    pub(crate) torque: Color32,
    pub(crate) ghost: Color32,
    /// The simulated hand, and the force on it.
    pub(crate) hand: Color32,
    pub(crate) good: Color32,
    pub(crate) warn: Color32,
    /// Colours of the sphere at its middle and at its edge.
    pub(crate) sphere: [Color32; 2],
    pub(crate) grid: Color32,
    pub(crate) wheel: Color32,
    /// Walls, notches and guides of the scene.
    pub(crate) felt: Color32,
    pub(crate) text: Color32,
    pub(crate) weak: Color32,
    /// The rim of what can be pressed or changed, as on the page in the browser.
    rim: Color32,
    /// The ground of what can be pressed.
    pub(crate) surface: Color32,
}

/// Colour of the stop button, on both light and dark backgrounds.
pub(crate) const STOP: Color32 = Color32::from_rgb(0xb8, 0x25, 0x08);
/// Colour of the word LIVE, as on the page in the browser, and of the tape below the bar of a real
/// rig. Nothing else has it.
pub(crate) const LIVE: Color32 = Color32::from_rgb(0xff, 0xc4, 0x00);

impl Palette {
    pub(crate) fn of(ui: &Ui) -> Self {
        Self::of_theme(ui.visuals().dark_mode, ui.visuals().weak_text_color())
    }

    /// Colour of the grid of a plot: pale, so that it does not compete with the curves.
    pub(crate) fn plot_grid(&self) -> Color32 {
        self.grid.gamma_multiply(0.35)
    }

    /// Returns the colours for a dark or a light background. `weak` is the colour of less important
    /// text.
    pub(crate) const fn of_theme(dark: bool, weak: Color32) -> Self {
        const fn rgb(r: u8, g: u8, b: u8) -> Color32 {
            Color32::from_rgb(r, g, b)
        }
        if dark {
            Self {
                axes: [rgb(0xf2, 0x77, 0x2e), rgb(0x22, 0xb8, 0x8c), rgb(0x56, 0xb4, 0xe9)],
                torque: rgb(0xe0, 0x8f, 0xbd),
                ghost: rgb(0xd8, 0xd0, 0x80),
                hand: rgb(0xb9, 0xa5, 0xff),
                good: rgb(0x9b, 0xd2, 0x4a),
                warn: rgb(0xf0, 0xb0, 0x20),
                sphere: [rgb(0x4a, 0x52, 0x5e), rgb(0x26, 0x2b, 0x33)],
                grid: rgb(0xb8, 0xc0, 0xcc),
                wheel: rgb(0xa0, 0xa0, 0xa0),
                felt: rgb(0xff, 0xff, 0xff),
                text: rgb(0xd8, 0xd8, 0xd8),
                weak,
                rim: rgb(0x6c, 0x75, 0x7f),
                surface: rgb(0x44, 0x4d, 0x57),
            }
        } else {
            Self {
                axes: [rgb(0xc2, 0x4e, 0x00), rgb(0x00, 0x7a, 0x58), rgb(0x00, 0x65, 0xa8)],
                torque: rgb(0xa0, 0x3c, 0x78),
                ghost: rgb(0x80, 0x72, 0x00),
                hand: rgb(0x5b, 0x3c, 0xc4),
                good: rgb(0x4a, 0x74, 0x0a),
                warn: rgb(0x8f, 0x5c, 0x00),
                sphere: [rgb(0xf4, 0xf6, 0xf8), rgb(0xc6, 0xcc, 0xd4)],
                grid: rgb(0x58, 0x60, 0x6c),
                wheel: rgb(0x60, 0x60, 0x60),
                felt: rgb(0x00, 0x00, 0x00),
                text: rgb(0x1c, 0x1c, 0x1c),
                weak,
                rim: rgb(0x86, 0x8d, 0x96),
                surface: rgb(0xd2, 0xd8, 0xdf),
            }
        }
    }

    /// Returns the colour of the edge and of the text of a message.
    pub(crate) const fn weight(&self, weight: Weight) -> Color32 {
        match weight {
            Weight::Good => self.good,
            Weight::Warn | Weight::Bad => self.warn,
        }
    }

    /// Returns the colour of a headline.
    pub(crate) const fn headline(&self, headline: Headline) -> Color32 {
        match headline {
            Headline::NotStopped | Headline::NoContact => self.text,
            Headline::NoState => self.weak,
            Headline::Mode(mode) => self.mode(mode),
        }
    }

    /// Returns the colour that stands for a mode of the rig. The page uses the same colours.
    pub(crate) const fn mode(&self, mode: Mode) -> Color32 {
        match mode {
            Mode::Active | Mode::Enabling => self.good,
            Mode::Idle | Mode::Unreferenced | Mode::Estop => self.text,
            Mode::Fault => self.warn,
        }
    }
}

/// Sets the style of the dark and the light theme. Call it once, at the start.
pub(crate) fn install(ctx: &egui::Context) {
    ctx.all_styles_mut(|style| {
        style.spacing.item_spacing = egui::vec2(8.0, 6.0);
        style.spacing.button_padding = egui::vec2(8.0, 4.0);
        style.interaction.selectable_labels = false;
        // People who use the keyboard must see the focus.
        style.visuals.selection.stroke.width = 2.0;
    });
    for (theme, weak_text_alpha) in [(egui::Theme::Dark, 0.75), (egui::Theme::Light, 0.8)] {
        ctx.style_mut_of(theme, |style| {
            let palette = Palette::of_theme(theme == egui::Theme::Dark, Color32::GRAY);
            style.visuals.override_text_color = Some(palette.text);
            style.visuals.weak_text_alpha = weak_text_alpha;
            let widgets = &mut style.visuals.widgets;
            for widget in [&mut widgets.inactive, &mut widgets.open] {
                widget.bg_stroke = egui::Stroke::new(1.0, palette.rim);
            }
            // What cannot be pressed is hollow.
            widgets.noninteractive.weak_bg_fill = Color32::TRANSPARENT;
            widgets.inactive.weak_bg_fill = palette.surface;
            // The ring of the control with the focus, as text fields have it.
            widgets.active.bg_stroke = style.visuals.selection.stroke;
        });
    }
}

/// Returns the button that leads on from here: it alone is filled, in the colour of the text.
pub(crate) fn leading<'a>(ui: &Ui, text: &str) -> egui::Button<'a> {
    let text = RichText::new(text).strong().color(ui.visuals().panel_fill);
    egui::Button::new(text).fill(Palette::of(ui).text)
}

/// Gives a control a name, which screen readers and tests use.
pub(crate) fn named(response: Response, name: &str) -> Response {
    response.ctx.accesskit_node_builder(response.id, |node| node.set_label(name));
    response
}

pub(crate) fn heading(ui: &mut Ui, text: &str) {
    ui.add_space(2.0);
    ui.label(heading_text(text));
}

pub(crate) fn heading_text(text: &str) -> RichText {
    RichText::new(text).strong().size(15.0)
}

pub(crate) fn weak(ui: &mut Ui, text: impl Into<String>) -> Response {
    ui.add(egui::Label::new(RichText::new(text).weak()).wrap())
}

/// Draws coloured text, which can take several lines.
pub(crate) fn coloured(ui: &mut Ui, color: Color32, text: impl Into<String>) -> Response {
    ui.add(egui::Label::new(RichText::new(text).color(color)).wrap())
}

/// Draws a label in a column of the given width.
pub(crate) fn column(ui: &mut Ui, width: f32, text: impl Into<egui::WidgetText>) -> Response {
    let layout = egui::Layout::left_to_right(egui::Align::Center);
    ui.allocate_ui_with_layout(egui::vec2(width, ui.spacing().interact_size.y), layout, |ui| {
        ui.set_min_width(width);
        ui.set_max_width(width);
        ui.add(egui::Label::new(text).truncate())
    })
    .inner
}

/// Draws a word on a coloured ground, in a place of fixed size.
pub(crate) fn badge(ui: &mut Ui, ground: Color32, word: &str) -> Response {
    let (rect, response) = ui.allocate_exact_size(egui::vec2(112.0, 20.0), egui::Sense::hover());
    let ink = if ground.intensity() > 0.5 { Color32::BLACK } else { Color32::WHITE };
    let painter = ui.painter();
    painter.rect_filled(rect, 4.0, ground);
    let font = egui::FontId::proportional(13.0);
    painter.text(rect.center(), egui::Align2::CENTER_CENTER, word, font, ink);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Label, true, word));
    response
}

/// Returns a text of parts of different sizes and colours.
pub(crate) fn sized(parts: &[(&str, f32, Color32)]) -> egui::text::LayoutJob {
    let mut job = egui::text::LayoutJob::default();
    for (text, size, color) in parts {
        let format = egui::TextFormat::simple(egui::FontId::proportional(*size), *color);
        job.append(text, 0.0, egui::TextFormat { valign: egui::Align::Center, ..format });
    }
    job
}

/// Returns `rect` filled with black and with an edge of slanted stripes in white and `color`. The
/// stripes are longer than the edge: the painter must clip them to `rect`.
pub(crate) fn stripes(rect: egui::Rect, color: Color32) -> egui::Shape {
    /// Widths of the edge and of a stripe, points.
    const EDGE: f32 = 6.0;
    const STRIPE: f32 = 6.0;
    let height = rect.height();
    let slanted = |x: f32| {
        let ends = [egui::pos2(x, rect.bottom()), egui::pos2(x + height, rect.top())];
        egui::Shape::line_segment(ends, (STRIPE, Color32::WHITE))
    };
    let count = ((rect.width() + height) / (3.0 * STRIPE)).ceil() as u16;
    let mut shapes = vec![egui::Shape::rect_filled(rect, 0.0, color)];
    shapes.extend((0..=count).map(|k| slanted(rect.left() - height + 3.0 * STRIPE * f32::from(k))));
    shapes.push(egui::Shape::rect_filled(rect.shrink(EDGE), 0.0, Color32::BLACK));
    egui::Shape::Vec(shapes)
}

/// Draws a tape with slanted black stripes, such as stands around machines, into `rect`.
pub(crate) fn tape(painter: &egui::Painter, rect: egui::Rect) {
    /// Distance of the stripes, points.
    const STRIPES: f32 = 24.0;
    let painter = painter.with_clip_rect(rect);
    painter.rect_filled(rect, 0.0, LIVE);
    let height = rect.height();
    let count = (rect.width() / STRIPES).ceil() as u16;
    for left in (0..=count).map(|k| rect.left() + STRIPES * f32::from(k)) {
        let corner = |x: f32, y: f32| egui::pos2(left + x, y);
        let [top, bottom] = [rect.top(), rect.bottom()];
        let points = vec![
            corner(height, top),
            corner(height + STRIPES / 2.0, top),
            corner(STRIPES / 2.0, bottom),
            corner(0.0, bottom),
        ];
        painter.add(egui::Shape::convex_polygon(points, Color32::BLACK, egui::Stroke::NONE));
    }
}

/// Draws a small coloured dot, which shows a state like a lamp.
pub(crate) fn lamp(ui: &mut Ui, color: Color32) {
    let (rect, _) = ui.allocate_exact_size(egui::vec2(10.0, 10.0), egui::Sense::hover());
    ui.painter().circle_filled(rect.center(), 5.0, color);
}
