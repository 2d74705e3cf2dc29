//! OIDN's `RT` filter on the CPU, through the raw functions of the oidn crate.
//!
//! The crate's own filter (2.5.1) always has a colour image, so it cannot denoise albedo or normals by themselves,
//! and it sets `clean_aux` where OIDN 2 listens to `cleanAux`; hence the raw functions, and only here.
#![expect(unsafe_code, reason = "calls into a C library")]

use std::ffi::{CStr, c_char};
use std::ptr;

use oidn::sys;

/// An OIDN device that uses the CPU.
pub(crate) struct Device(sys::OIDNDevice);

/// Inputs of one filter; each plane holds one entry per pixel.
///
/// Colour alone, a feature alone (which denoises that feature), or colour with clean features.
#[derive(Default)]
pub(crate) struct Images<'a> {
    /// Radiance of any range.
    pub(crate) color: Option<&'a [[f32; 3]]>,
    /// Reflectance, 0 to 1.
    pub(crate) albedo: Option<&'a [[f32; 3]]>,
    /// Normals, -1 to 1.
    pub(crate) normal: Option<&'a [[f32; 3]]>,
}

impl Device {
    /// Opens the device with this many threads; 0 means one for each processor.
    pub(crate) fn new(threads: u32) -> Result<Self, String> {
        // SAFETY: no preconditions; a null device is checked before it is used.
        let device = unsafe { sys::oidnNewDevice(sys::OIDNDeviceType_OIDN_DEVICE_TYPE_CPU) };
        if device.is_null() {
            let reason = last_error(ptr::null_mut()).unwrap_or_else(|| "no device".into());
            return Err(format!(
                "{reason}\nhint: its library is missing or broken; `./run setup` fetches it"
            ));
        }
        let device = Self(device);
        if threads > 0 {
            let threads = i32::try_from(threads).unwrap_or(i32::MAX);
            // SAFETY: the device is valid and not yet committed; the name ends in zero.
            unsafe { sys::oidnSetDeviceInt(device.0, c"numThreads".as_ptr(), threads) };
        }
        // SAFETY: the device is valid.
        unsafe { sys::oidnCommitDevice(device.0) };
        last_error(device.0).map_or(Ok(device), Err)
    }

    /// Runs one filter over planes of `size` (width, height) and returns what it makes of the first image given.
    pub(crate) fn run(
        &self,
        (width, height): (usize, usize),
        images: &Images<'_>,
    ) -> Result<Vec<[f32; 3]>, String> {
        let mut output = vec![[0.0; 3]; width * height];
        // SAFETY: the device is valid; the name ends in zero.
        let filter = unsafe { sys::oidnNewFilter(self.0, c"RT".as_ptr()) };
        if filter.is_null() {
            return Err(last_error(self.0).unwrap_or_else(|| "no filter".into()));
        }
        let set = |name: &CStr, plane: *mut [f32; 3]| {
            // SAFETY: the filter is valid; the plane has width x height packed pixels and outlives the filter, which
            // only reads the inputs and is the only one to write the output.
            unsafe {
                sys::oidnSetSharedFilterImage(
                    filter,
                    name.as_ptr(),
                    plane.cast(),
                    sys::OIDNFormat_OIDN_FORMAT_FLOAT3,
                    width,
                    height,
                    0,
                    0,
                    0,
                );
            }
        };
        let inputs = [(c"color", images.color), (c"albedo", images.albedo), (c"normal", images.normal)];
        for (name, plane) in inputs.into_iter().filter_map(|(name, plane)| Some((name, plane?))) {
            assert_eq!(plane.len(), output.len(), "planes are read in the size of the picture");
            set(name, plane.as_ptr().cast_mut());
        }
        set(c"output", output.as_mut_ptr());
        let features = images.albedo.is_some() || images.normal.is_some();
        let flags = [(c"hdr", images.color.is_some()), (c"cleanAux", images.color.is_some() && features)];
        for (name, _) in flags.into_iter().filter(|(_, on)| *on) {
            // SAFETY: the filter is valid; the name ends in zero.
            unsafe { sys::oidnSetFilterBool(filter, name.as_ptr(), true) };
        }
        // SAFETY: the filter is valid and its images are alive; it is not used after its release.
        unsafe {
            sys::oidnCommitFilter(filter);
            sys::oidnExecuteFilter(filter);
            sys::oidnReleaseFilter(filter);
        }
        last_error(self.0).map_or(Ok(output), Err)
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the device is valid and this is its only owner.
        unsafe { sys::oidnReleaseDevice(self.0) };
    }
}

/// The first error since the last call, if there is one; a null device stands for errors without a device.
fn last_error(device: sys::OIDNDevice) -> Option<String> {
    let mut message: *const c_char = ptr::null();
    // SAFETY: the device is valid or null, both of which are allowed.
    let code = unsafe { sys::oidnGetDeviceError(device, &raw mut message) };
    if code == sys::OIDNError_OIDN_ERROR_NONE {
        return None;
    }
    if message.is_null() {
        return Some(format!("error {code} of OIDN"));
    }
    // SAFETY: OIDN returns a text that ends in zero and lives until the next call on this thread.
    let text = unsafe { CStr::from_ptr(message) };
    Some(text.to_string_lossy().into_owned())
}
