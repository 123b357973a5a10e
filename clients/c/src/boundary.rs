//! Everything that crosses the ABI: pointers, texts and panics.

use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::status::{Failure, HbotStatus, remember};

/// Runs the body of a function of the ABI. A failure becomes its status and the text of the last
/// error; so does a panic, which must not leave the library.
pub(crate) fn guarded(body: impl FnOnce() -> Result<HbotStatus, Failure>) -> HbotStatus {
    let failure = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(status)) => return status,
        Ok(Err(failure)) => failure,
        Err(panic) => {
            let text = panic.downcast_ref::<&str>().copied().map(str::to_owned);
            let text = text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default();
            Failure::new(HbotStatus::Panic, format!("a defect of the client library: {text}"))
        }
    };
    remember(&failure.text);
    failure.status
}

fn null(name: &str) -> Failure {
    Failure::new(HbotStatus::NullPointer, format!("{name} is NULL"))
}

/// Reads a text that must be there. `name` is that of the argument.
///
/// # Safety
/// `text` is null or points to a text that ends with a zero byte and lives as long as `'a`.
pub(crate) unsafe fn text<'a>(text: *const c_char, name: &str) -> Result<&'a str, Failure> {
    // SAFETY: the contract of this function is that of the one called.
    unsafe { optional_text(text, name) }?.ok_or_else(|| null(name))
}

/// Reads a text that can be null.
///
/// # Safety
/// As for [`text`].
pub(crate) unsafe fn optional_text<'a>(text: *const c_char, name: &str) -> Result<Option<&'a str>, Failure> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: not null, so the caller promises a text that ends with a zero byte.
    let text = unsafe { CStr::from_ptr(text) };
    let not_utf8 = |_| Failure::new(HbotStatus::NotUtf8, format!("{name} is not UTF-8"));
    text.to_str().map(Some).map_err(not_utf8)
}

/// Reads an argument that is given by pointer and must be there.
///
/// # Safety
/// `value` is null or points to an initialised `T` that lives as long as `'a`.
pub(crate) unsafe fn input<'a, T>(value: *const T, name: &str) -> Result<&'a T, Failure> {
    // SAFETY: the contract of this function is that of the one called.
    unsafe { value.as_ref() }.ok_or_else(|| null(name))
}

/// A pointer to a result that is not null.
pub(crate) struct Out<T>(*mut T);

impl<T> Out<T> {
    /// Checks the pointer before the request is sent.
    ///
    /// # Safety
    /// `pointer` is null or points to memory for a `T` that can be written while the result lives.
    pub(crate) unsafe fn new(pointer: *mut T, name: &str) -> Result<Self, Failure> {
        if pointer.is_null() { Err(null(name)) } else { Ok(Self(pointer)) }
    }

    /// Writes the result, without reading what was there.
    pub(crate) fn write(self, value: T) {
        // SAFETY: not null, and `new` was promised that the memory can be written.
        unsafe { self.0.write(value) }
    }
}

/// Copies a text into an array that always ends with a zero byte. A text that is too long is cut
/// between two characters.
pub(crate) fn copied<const N: usize>(text: &str) -> [c_char; N] {
    let mut end = text.len().min(N - 1);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let mut array = [0; N];
    for (to, from) in array.iter_mut().zip(text[..end].bytes()) {
        // A byte is a byte: C decides whether its `char` has a sign.
        *to = from.cast_signed() as c_char;
    }
    array
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::hbot_last_error;

    #[test]
    fn a_panic_becomes_a_status_and_a_text() {
        let status = guarded(|| panic!("index {} of 3", 7));
        assert_eq!(status, HbotStatus::Panic);
        // SAFETY: the text of the last error lives until the next failing call of this thread.
        let text = unsafe { super::text(hbot_last_error(), "text") }.expect("a text");
        assert_eq!(text, "a defect of the client library: index 7 of 3");
    }

    #[test]
    fn a_long_text_is_cut_between_characters() {
        let array = copied::<6>("abcdµf");
        let bytes: Vec<u8> = array.iter().map(|byte| byte.cast_unsigned()).collect();
        assert_eq!(bytes, b"abcd\0\0", "the two bytes of the fifth character do not fit");
        assert_eq!(copied::<4>("abc")[3], 0);
    }
}
