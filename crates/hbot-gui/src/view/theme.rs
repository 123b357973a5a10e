//! Colours, each with one meaning, and small widgets that look alike in the whole window.

use eframe::egui::{
    self, Color32, FontData, FontDefinitions, FontFamily, FontId, Response, RichText, TextStyle, Ui,
};
use hbot_api::Mode;

use crate::model::Headline;

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
    surface: Color32,
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

    /// Returns the colours for a dark or a light background. `weak` is the colour of less important
    /// text.
    pub(crate) const fn of_theme(dark: bool, weak: Color32) -> Self {
        const fn rgb(dark: bool, [light, in_dark]: [u32; 2]) -> Color32 {
            let [_, r, g, b] = (if dark { in_dark } else { light }).to_be_bytes();
            Color32::from_rgb(r, g, b)
        }
        Self {
            axes: [
                rgb(dark, [0xc24e00, 0xf2772e]),
                rgb(dark, [0x007a58, 0x22b88c]),
                rgb(dark, [0x0065a8, 0x56b4e9]),
            ],
            torque: rgb(dark, [0xa03c78, 0xe08fbd]),
            ghost: rgb(dark, [0x807200, 0xd8d080]),
            hand: rgb(dark, [0x5b3cc4, 0xb9a5ff]),
            good: rgb(dark, [0x4a740a, 0x9bd24a]),
            warn: rgb(dark, [0x8f5c00, 0xf0b020]),
            sphere: [rgb(dark, [0xf4f6f8, 0x4a525e]), rgb(dark, [0xc6ccd4, 0x262b33])],
            grid: rgb(dark, [0x58606c, 0xb8c0cc]),
            wheel: rgb(dark, [0x606060, 0xa0a0a0]),
            felt: rgb(dark, [0x000000, 0xffffff]),
            text: rgb(dark, [0x1c1c1c, 0xd8d8d8]),
            rim: rgb(dark, [0x868d96, 0x6c757f]),
            surface: rgb(dark, [0xd2d8df, 0x444d57]),
            weak,
        }
    }

    pub(crate) const fn headline(&self, headline: Headline) -> Color32 {
        match headline {
            Headline::Mode(mode) => self.mode(mode),
            _ => self.text,
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

/// Opacity of a button that cannot be pressed. Its text is not weak.
const LOCKED: f32 = 0.65;

/// Name of the family of text that nobody may miss. What it lacks comes from the usual fonts.
const BOLD: &str = "bold";

/// Sets the fonts, and the style of the dark and the light theme. Call it once, at the start.
pub(crate) fn install(ctx: &egui::Context) {
    let mut fonts = FontDefinitions::default();
    let data = FontData::from_static(include_bytes!("../../fonts/Ubuntu-Bold.ttf"));
    fonts.font_data.insert(BOLD.to_owned(), data.into());
    let usual = &fonts.families[&FontFamily::Proportional];
    let family = [&[BOLD.to_owned()], usual.as_slice()].concat();
    fonts.families.insert(FontFamily::Name(BOLD.into()), family);
    ctx.set_fonts(fonts);
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
            // An observer reads what is locked: also weak text has a contrast of 4.5.
            style.visuals.disabled_alpha = 0.8;
            let widgets = &mut style.visuals.widgets;
            for widget in [&mut widgets.inactive, &mut widgets.open] {
                widget.bg_stroke = egui::Stroke::new(1.0, palette.rim);
            }
            widgets.inactive.weak_bg_fill = palette.surface;
            // The ring of the control with the focus, as text fields have it.
            widgets.active.bg_stroke = style.visuals.selection.stroke;
        });
    }
}

/// Returns the bold font in this size, or the usual one before [`install`].
pub(crate) fn bold(ui: &Ui, size: f32) -> FontId {
    let family = FontFamily::Name(BOLD.into());
    let known = ui.fonts(|fonts| fonts.definitions().families.contains_key(&family));
    FontId::new(size, if known { family } else { FontFamily::Proportional })
}

/// Returns a bold text in the size of the text around it.
pub(crate) fn bold_text(ui: &Ui, text: impl Into<String>) -> RichText {
    RichText::new(text).font(bold(ui, TextStyle::Body.resolve(ui.style()).size))
}

/// Returns the button that leads on from here: it alone is filled, in the colour of the text.
pub(crate) fn leading<'a>(ui: &Ui, text: &str) -> egui::Button<'a> {
    let text = bold_text(ui, text).color(ui.visuals().panel_fill);
    egui::Button::new(text).fill(Palette::of(ui).text)
}

/// Draws a button. One that cannot be pressed is hollow, and greyer than what is only locked.
pub(crate) fn press(ui: &mut Ui, enabled: bool, button: egui::Button<'_>) -> Response {
    let alpha = ui.visuals().disabled_alpha;
    ui.visuals_mut().disabled_alpha = LOCKED;
    let response = ui.add_enabled(enabled, if enabled { button } else { button.fill(Color32::TRANSPARENT) });
    ui.visuals_mut().disabled_alpha = alpha;
    response
}

/// Gives a control a name, which screen readers and tests use.
pub(crate) fn named(response: Response, name: &str) -> Response {
    response.ctx.accesskit_node_builder(response.id, |node| node.set_label(name));
    response
}

pub(crate) fn heading(ui: &mut Ui, text: &str) {
    ui.add_space(2.0);
    ui.label(heading_text(ui, text));
}

pub(crate) fn heading_text(ui: &Ui, text: &str) -> RichText {
    RichText::new(text).font(bold(ui, 14.0))
}

/// Draws text that can take several lines.
pub(crate) fn wrapped(ui: &mut Ui, text: impl Into<egui::WidgetText>) -> Response {
    ui.add(egui::Label::new(text).wrap())
}

pub(crate) fn weak(ui: &mut Ui, text: impl Into<String>) -> Response {
    wrapped(ui, RichText::new(text).weak())
}

/// Draws coloured text, which can take several lines.
pub(crate) fn coloured(ui: &mut Ui, color: Color32, text: impl Into<String>) -> Response {
    wrapped(ui, RichText::new(text).color(color))
}

/// Draws a label in a column of the given width. A text that is too long ends in dots.
pub(crate) fn column(ui: &mut Ui, width: f32, text: impl Into<egui::WidgetText>) -> Response {
    let layout = egui::Layout::left_to_right(egui::Align::Center);
    cell(ui, width, layout, egui::Label::new(text).truncate())
}

/// Draws a label in a place of the given width.
pub(crate) fn cell(ui: &mut Ui, width: f32, layout: egui::Layout, label: egui::Label) -> Response {
    let size = egui::vec2(width, ui.spacing().interact_size.y);
    let draw = |ui: &mut Ui| {
        ui.set_width(width);
        ui.add(label)
    };
    ui.allocate_ui_with_layout(size, layout, draw).inner
}

/// Draws a word on a coloured ground, in a place of fixed size.
pub(crate) fn badge(ui: &mut Ui, ground: Color32, word: &str) -> Response {
    let (rect, response) = ui.allocate_exact_size(egui::vec2(112.0, 20.0), egui::Sense::hover());
    let ink = if ground.intensity() > 0.5 { Color32::BLACK } else { Color32::WHITE };
    let painter = ui.painter();
    painter.rect_filled(rect, 4.0, ground);
    painter.text(rect.center(), egui::Align2::CENTER_CENTER, word, bold(ui, 13.0), ink);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Label, true, word));
    response
}

/// Returns a text of parts of different fonts and colours.
pub(crate) fn sized(parts: &[(&str, FontId, Color32)]) -> egui::text::LayoutJob {
    let mut job = egui::text::LayoutJob::default();
    for (text, font, color) in parts {
        let format = egui::TextFormat::simple(font.clone(), *color);
        job.append(text, 0.0, egui::TextFormat { valign: egui::Align::Center, ..format });
    }
    job
}

/// Returns `rect` filled with `ground`, and on it slanted stripes of this width in `color`, such as
/// stand around machines. They are longer than `rect`: the painter must clip them to it.
pub(crate) fn stripes(rect: egui::Rect, ground: Color32, width: f32, color: Color32) -> Vec<egui::Shape> {
    let (height, every) = (rect.height(), 3.0 * width);
    let slanted = |k: u16| {
        let x = rect.left() - height + every * f32::from(k);
        let ends = [
            egui::pos2(x - width, rect.bottom() + width),
            egui::pos2(x + height + width, rect.top() - width),
        ];
        egui::Shape::line_segment(ends, (width, color))
    };
    let count = ((rect.width() + height) / every).ceil() as u16;
    let ground = egui::Shape::rect_filled(rect, 0.0, ground);
    std::iter::once(ground).chain((0..=count).map(slanted)).collect()
}

/// Draws a small coloured dot, which shows a state like a lamp.
pub(crate) fn lamp(ui: &mut Ui, color: Color32) {
    let (rect, _) = ui.allocate_exact_size(egui::vec2(10.0, 10.0), egui::Sense::hover());
    ui.painter().circle_filled(rect.center(), 5.0, color);
}
