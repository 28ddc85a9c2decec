//! The user's choice of a Vulkan device.

/// The device that the user requests.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The best device: discrete, integrated, virtual, then CPU.
    #[default]
    Best,
    /// A software device.
    Cpu,
    /// Anything but a software device.
    Gpu,
    /// By index in the list of `etalon devices`.
    Index(usize),
    /// By part of the device's name, ignoring case.
    Name(String),
}

impl std::str::FromStr for DeviceChoice {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "cpu" => Self::Cpu,
            "gpu" => Self::Gpu,
            _ => text.parse().map_or_else(|_| Self::Name(text.to_owned()), Self::Index),
        })
    }
}

impl std::fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Best => f.write_str("a device"),
            Self::Cpu => f.write_str("a software device"),
            Self::Gpu => f.write_str("a GPU"),
            Self::Index(i) => write!(f, "a device of index {i}"),
            Self::Name(name) => write!(f, "a device named like \"{name}\""),
        }
    }
}
