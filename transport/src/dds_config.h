/// The configuration of a DDS domain, in Cyclone DDS's own words, from our options.
///
/// Interfaces  Those named. None named: what the environment's CYCLONEDDS_URI says, and without
///             that the loopback interface alone, so that nothing reaches a network unasked.
/// Discovery   By multicast where the interface has it, and to each peer named, once a second; data
///             goes by unicast to those who listen. On loopback the machine itself is a peer:
///             discovery works there without multicast, too.
/// Memory      The caller's; nothing is kept. Not for the planning path.
#ifndef VERGE_DDS_CONFIG_H
#define VERGE_DDS_CONFIG_H

#include "verge/transport.h"

#include <net/if.h>

enum {
    DDS_CONFIG_SIZE = 16384,
    DDS_DOMAIN_MAX = 230, // the last whose ports are below 65536
    DDS_INTERFACES_MAX = 8,
    DDS_PEERS_MAX = 32,
    DDS_SETTINGS = 10,
};

/// The settings "dds.interfaces", "dds.security" and so on.
extern const transport_setting_def dds_settings[DDS_SETTINGS];

/// Writes the configuration of the domain, a text for dds_create_domain(). False: error has a line.
bool dds_config_write(const transport_options* options, uint32_t domain, char* text, size_t size,
                      char* error, size_t error_size);

/// The names of the interfaces in use; none where CYCLONEDDS_URI chooses them.
uint32_t dds_config_interfaces(const transport_options* options,
                               char names[DDS_INTERFACES_MAX][IF_NAMESIZE]);
/// Does the interface work? Allocates nothing.
bool dds_config_interface_up(const char* name);
/// CYCLONEDDS_URI where it decides on the interfaces; else null.
const char* dds_config_environment(const transport_options* options);

/// Is more than the loopback interface in use? Then interface tells which is.
bool dds_config_leaves(const transport_options* options, char* interface, size_t size);

#endif
