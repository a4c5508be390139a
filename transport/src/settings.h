/// Reading transport_options by the names of their settings, for backends.
///
/// Memory      Nothing is copied or allocated: texts live as long as the options.
#ifndef SETTINGS_H
#define SETTINGS_H

#include "verge/transport.h"

/// How often a setting is given.
uint32_t setting_count(const transport_options* options, const char* name);
/// The value given at this place among those of its name. Null: there is none.
const char* setting_text(const transport_options* options, const char* name, uint32_t index);
/// The same of a number; where none is given its preset, or 0.
uint32_t setting_number(const transport_options* options, const char* name, uint32_t index);

/// Is every setting of the options one that a bus has, in its range, not given too often, and are
/// the members of objects complete? False: error has one line that begins with the setting's name.
bool settings_check(const transport_options* options, char* error, size_t error_size);

#endif
