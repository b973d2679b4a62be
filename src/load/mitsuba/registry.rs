//! Tables of plugins by name.

use super::document::Element;
use crate::load::faults::Faults;

/// Plugins of one tag.
pub struct Registry<F: 'static> {
    /// The tag whose `type` names the plugin.
    pub tag: &'static str,
    /// Names and what reads them.
    pub plugins: &'static [(&'static str, F)],
}

impl<F: Copy> Registry<F> {
    /// The plugin that an element's type names; an unknown one is a fault that lists those known.
    pub fn find(&self, element: &Element, faults: &Faults) -> Option<F> {
        let name = &element.attribute("type")?.value;
        let found = self.plugins.iter().find(|(known, _)| known == name).map(|(_, plugin)| *plugin);
        if found.is_none() {
            let known: Vec<_> = self.plugins.iter().map(|(name, _)| *name).collect();
            faults.unknown(element.span_of("type"), self.tag, name, &known);
        }
        found
    }
}
