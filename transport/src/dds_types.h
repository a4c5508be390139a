/// The DDS types of the schema. The structs idlc makes of verge.idl and those lcm-gen makes of
/// verge.lcm agree in every offset and size (asserted in dds_types.c). DDS therefore reads and
/// writes the memory of the latter, and the rest of the transport has one struct for each message.
#ifndef VERGE_DDS_TYPES_H
#define VERGE_DDS_TYPES_H

#include "verge/transport.h"

#include <dds/dds.h>

/// Null for kinds that are not on DDS.
const dds_topic_descriptor_t* dds_type_of(transport_kind kind);

#endif
