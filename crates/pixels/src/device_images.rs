//! The images of one device: their format, the grey level of a Bayer mosaic, and the views in an image.

use fringeflow_base::grey::PixelFormat;

use super::bayer::BayerGrey;
use super::source_format::SourceFormat;
use super::stereo::StereoLayout;

/// Smallest side of a mosaic of which grey levels are interpolated, pixels.
const LEAST_MOSAIC_PX: usize = 2;

/// Format and arrangement of the images of one device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceImages {
    format: SourceFormat,
    bayer: BayerGrey,
    layout: Option<StereoLayout>,
}

/// Why a format and an arrangement do not fit each other, or do not fit the size of the images.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceImagesError {
    /// The format has no colour mosaic.
    #[error(
        "{format} images are no Bayer mosaic: remove the choice {:?}, or use a Bayer format such as RGGB", grey.name()
    )]
    NoMosaic {
        /// The format.
        format: SourceFormat,
        /// The choice of the grey level.
        grey: BayerGrey,
    },
    /// The format has an arrangement of its own.
    #[error("{format} images hold both views, pixel by pixel in turn: remove the layout {layout}")]
    Interleaved {
        /// The format.
        format: SourceFormat,
        /// The arrangement.
        layout: StereoLayout,
    },
    /// Squares of the mosaic are summed, so that there is no choice.
    #[error(
        "with binning {binning}, squares of red, two green and blue pixels are summed: remove the choice {:?}, or use \
         binning 1", BayerGrey::Green.name()
    )]
    GreenBinned {
        /// The binning.
        binning: usize,
    },
    /// The image cannot be halved.
    #[error(
        "an image of {} × {} pixels cannot hold two views {layout}: {} is odd", image_px[0], image_px[1],
        match layout { StereoLayout::SideBySide => "its width", StereoLayout::TopBottom => "its height" }
    )]
    OddSide {
        /// The arrangement.
        layout: StereoLayout,
        /// Width and height of the whole image, pixels.
        image_px: [usize; 2],
    },
    /// The border between the views is not between two bytes, or not between two cells of the mosaic.
    #[error(
        "two views of {} × {} pixels {layout} cut a group of pixels that {format} stores together; the side that is \
         divided must be a multiple of {multiple}", view_px[0], view_px[1]
    )]
    CutGroup {
        /// The format.
        format: SourceFormat,
        /// The arrangement.
        layout: StereoLayout,
        /// Width and height of a view, pixels.
        view_px: [usize; 2],
        /// The view must have a multiple of this number of pixels.
        multiple: usize,
    },
    /// The mosaic has no neighbours of the other colours.
    #[error(
        "a mosaic of {} × {} pixels is too small; both sides need {LEAST_MOSAIC_PX} pixels", view_px[0], view_px[1]
    )]
    Small {
        /// Width and height of a view, pixels.
        view_px: [usize; 2],
    },
}

impl DeviceImages {
    /// Images of this format. `bayer` is the grey level of a Bayer mosaic, if it is chosen; `layout` the arrangement of
    /// two views, if an image holds both.
    ///
    /// # Errors
    /// The format has no mosaic, or an arrangement of its own.
    pub fn new(
        format: SourceFormat,
        bayer: Option<BayerGrey>,
        layout: Option<StereoLayout>,
    ) -> Result<Self, DeviceImagesError> {
        if let Some(grey) = bayer.filter(|_| format.bayer_order().is_none()) {
            return Err(DeviceImagesError::NoMosaic { format, grey });
        }
        if let Some(layout) = layout.filter(|_| format.is_interleaved()) {
            return Err(DeviceImagesError::Interleaved { format, layout });
        }
        Ok(Self { format, bayer: bayer.unwrap_or_default(), layout })
    }

    /// Format of the images.
    #[must_use]
    pub fn format(&self) -> SourceFormat {
        self.format
    }

    /// Arrangement of two views; `None` if there is one view, or if the format has an arrangement of its own.
    #[must_use]
    pub fn layout(&self) -> Option<StereoLayout> {
        self.layout
    }

    /// Grey level of a mosaic; `None` for other formats.
    #[must_use]
    pub fn bayer(&self) -> Option<BayerGrey> {
        self.format.bayer_order().map(|_| self.bayer)
    }

    /// Whether an image holds the views of both cameras.
    #[must_use]
    pub fn holds_both_views(&self) -> bool {
        self.layout.is_some() || self.format.is_interleaved()
    }

    /// Number of views in an image: 1, or 2 if it holds those of both cameras.
    #[must_use]
    pub fn views(&self) -> usize {
        if self.holds_both_views() { 2 } else { 1 }
    }

    /// How grey levels are interpolated; `None` if each value of the image is a grey level, or if squares are summed.
    #[must_use]
    pub fn interpolation(&self, binning: usize) -> Option<BayerGrey> {
        let is_mosaic = self.format.bayer_order().is_some() && binning == 1;
        Some(self.bayer).filter(|&grey| is_mosaic && grey != BayerGrey::Raw)
    }

    /// Format of the converted images. Interpolated grey levels keep the bits of the sums behind them, up to 16.
    #[must_use]
    pub fn pixel_format(&self, binning: usize) -> PixelFormat {
        let samples = self.format.pixel_format();
        match self.interpolation(binning) {
            // The weights add up to 16.
            Some(BayerGrey::Weighted) => samples.binned(2).binned(2),
            // Four neighbours.
            Some(BayerGrey::Green) => samples.binned(2),
            Some(BayerGrey::Raw) | None => samples.binned(binning),
        }
    }

    /// Checks that the grey level of a mosaic can be formed with this binning.
    ///
    /// # Errors
    /// Green levels are chosen, but squares of all colours are summed.
    pub fn check_binning(&self, binning: usize) -> Result<(), DeviceImagesError> {
        let is_refused = binning > 1 && self.bayer() == Some(BayerGrey::Green);
        if is_refused { Err(DeviceImagesError::GreenBinned { binning }) } else { Ok(()) }
    }

    /// Width and height of a whole image, from those of a view, pixels. A format with an arrangement of its own counts
    /// the pixels of one view.
    ///
    /// # Errors
    /// The border between the views would cut a group of pixels, or a mosaic is too small.
    pub fn image_px(&self, view_px: [usize; 2]) -> Result<[usize; 2], DeviceImagesError> {
        self.check_view(view_px)?;
        let [width, height] = view_px;
        Ok(match self.layout {
            None => view_px,
            Some(StereoLayout::SideBySide) => [width.saturating_mul(2), height],
            Some(StereoLayout::TopBottom) => [width, height.saturating_mul(2)],
        })
    }

    /// Width and height of a view, from those of a whole image, pixels.
    ///
    /// # Errors
    /// The image cannot be halved, or the border between the views would cut a group of pixels.
    pub fn view_px(&self, image_px: [usize; 2]) -> Result<[usize; 2], DeviceImagesError> {
        let mut view_px = image_px;
        if let Some(layout) = self.layout {
            let side = &mut view_px[layout.divided_side()];
            if !side.is_multiple_of(2) {
                return Err(DeviceImagesError::OddSide { layout, image_px });
            }
            *side /= 2;
        }
        self.check_view(view_px)?;
        Ok(view_px)
    }

    fn check_view(&self, view_px: [usize; 2]) -> Result<(), DeviceImagesError> {
        if let Some(layout) = self.layout {
            let format = self.format;
            // The second view must begin with the colour of the first.
            let cell = if format.bayer_order().is_some() { 2 } else { 1 };
            let multiple = match layout {
                StereoLayout::SideBySide => format.group_px().max(cell),
                StereoLayout::TopBottom => cell,
            };
            if !view_px[layout.divided_side()].is_multiple_of(multiple) {
                return Err(DeviceImagesError::CutGroup { format, layout, view_px, multiple });
            }
        }
        if self.interpolation(1).is_some() && view_px.iter().any(|&side| side < LEAST_MOSAIC_PX) {
            return Err(DeviceImagesError::Small { view_px });
        }
        Ok(())
    }
}

impl From<SourceFormat> for DeviceImages {
    /// One view in each image, and the default grey level of a mosaic.
    fn from(format: SourceFormat) -> Self {
        Self { format, ..Self::default() }
    }
}
