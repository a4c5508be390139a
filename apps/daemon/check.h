/// What --check-config of a daemon finds beyond its configuration file: errors and risks that only
/// show when the planner is built and the buses are opened.
#ifndef VERGE_DAEMON_CHECK_H
#define VERGE_DAEMON_CHECK_H

#include "daemon/site.h"

/// Builds the planner and opens each bus for these kinds of messages (TRANSPORT_ bits). Errors and
/// warnings go to standard error, each one line that begins with config_path; the planner's memory
/// and the road to standard output, unless quiet. A bus that is not available now, one that
/// strangers can reach, and a certificate that ends soon are warnings. Returns 0, EXIT_CONFIG or
/// EXIT_OS.
int check_site(const site* site, unsigned use, const char* config_path, bool quiet);

/// The same for the bus of one key. Returns 0, or EXIT_CONFIG with a line in error, without
/// config_path.
int check_bus(const site* site, const char* key, const char* url, unsigned use,
              const char* config_path, char error[CONFIG_ERROR_SIZE]);

#endif
