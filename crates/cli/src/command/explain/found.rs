//! Pages found for a word, ordered by likelihood.

use super::page::Page;

/// Pages with how likely each is what was meant, from 0 to 100.
#[derive(Default)]
pub(super) struct Found {
    pages: Vec<(u8, Page)>,
}

impl Found {
    /// Adds a page, unless it is there already.
    pub(super) fn add(&mut self, likelihood: u8, page: Page) {
        if self.pages.iter().all(|(_, other)| other.title() != page.title()) {
            self.pages.push((likelihood, page));
        }
    }

    /// Adds pages that are equally likely.
    pub(super) fn extend(&mut self, likelihood: u8, pages: impl IntoIterator<Item = Page>) {
        for page in pages {
            self.add(likelihood, page);
        }
    }

    /// Tells if there is a page with this likelihood or a higher one.
    pub(super) fn has(&self, likelihood: u8) -> bool {
        self.pages.iter().any(|(own, _)| *own >= likelihood)
    }

    pub(super) fn len(&self) -> usize {
        self.pages.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.pages.is_empty()
    }

    /// The pages with their likelihoods, as they came.
    pub(super) fn into_parts(self) -> Vec<(u8, Page)> {
        self.pages
    }

    /// The pages, the most likely first.
    pub(super) fn into_pages(mut self) -> Vec<Page> {
        self.pages.sort_by_key(|(likelihood, _)| std::cmp::Reverse(*likelihood));
        self.pages.into_iter().map(|(_, page)| page).collect()
    }
}
