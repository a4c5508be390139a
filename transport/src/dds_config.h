/// The configuration of a DDS domain for Cyclone DDS, from the options of the bus.
///
/// Interfaces  Those of the options. Without any: those of the environment's CYCLONEDDS_URI, else
///             only the loopback interface, so that no data reaches a network by default.
/// Discovery   By multicast if the interface supports it, and to each peer of the options, once a
///             second; data is sent by unicast to the readers. On loopback the machine itself is a
///             peer, so discovery works there without multicast, too.
/// Memory      That of the caller. At start-up only.
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
/// CYCLONEDDS_URI if it determines the interfaces, else null.
const char* dds_config_environment(const transport_options* options);

/// True: another interface than loopback is in use. Then `interface` holds its name.
bool dds_config_leaves(const transport_options* options, char* interface, size_t size);

#endif
