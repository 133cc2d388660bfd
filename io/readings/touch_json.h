#pragma once

#include <string>

#include "mapping/store/touch_journal.h"

namespace felt {

/// The touch journal as JSON, without region masks (they are grids of their own).
std::string touch_journal_json(const TouchJournal& journal);

/// Reads it back; regions are empty. Throws FormatError naming `where` and what is wrong.
TouchJournal parse_touch_journal(const std::string& text, const std::string& where);

}  // namespace felt
