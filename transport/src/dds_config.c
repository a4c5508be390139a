#include "dds_config.h"

#include "settings.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

/// A text in a buffer of fixed size, marked if it did not fit.
typedef struct text {
    char*  bytes;
    size_t used, room;
    bool   whole;
} text;

static void put(text* self, const char* format, ...) __attribute__((format(printf, 2, 3)));
static void put_escaped(text* self, const char* value);
static void put_interfaces(text* self, const transport_options* options);
static void put_discovery(text* self, const transport_options* options, uint32_t domain,
                          bool theirs);
static bool interface_known(const char* interface, char name[IF_NAMESIZE], char* names,
                            size_t names_size);
static bool interfaces_check(const transport_options* options, uint32_t domain, char* error,
                             size_t error_size);

const transport_setting_def dds_settings[DDS_SETTINGS] = {
    { .name = "dds.interfaces", .kind = TRANSPORT_SETTING_TEXT, .list_max = DDS_INTERFACES_MAX,
      .text = "network interfaces to use, by name or address; empty: as CYCLONEDDS_URI says, or "
              "loopback if it is not set" },
    { .name = "dds.peers", .kind = TRANSPORT_SETTING_TEXT, .list_max = DDS_PEERS_MAX,
      .text = "addresses of hosts that multicast does not reach" },
    { .name = "dds.deadline_ms", .kind = TRANSPORT_SETTING_NUMBER, .max = 60000, .preset = "0",
      .unit = "ms",
      .text = "the period that every sender of states must promise. Each missed deadline is "
              "counted and logged; a sender without this promise is not heard. 0: no promise is "
              "required" },
    { .name = "dds.security", .kind = TRANSPORT_SETTING_GROUP,
      .text = "DDS Security, files in PEM and S/MIME; absent: no security" },
    { .name = "dds.security.identity_ca", .kind = TRANSPORT_SETTING_FILE,
      .text = "certificate of the authority that signed the certificates of all participants" },
    { .name = "dds.security.certificate", .kind = TRANSPORT_SETTING_FILE,
      .text = "certificate of this unit" },
    { .name = "dds.security.key", .kind = TRANSPORT_SETTING_FILE,
      .text = "private key of this unit, readable by the daemon only (mode 0600)" },
    { .name = "dds.security.permissions_ca", .kind = TRANSPORT_SETTING_FILE,
      .text = "certificate of the authority that signed governance and permissions" },
    { .name = "dds.security.governance", .kind = TRANSPORT_SETTING_FILE,
      .text = "rules of the domain, signed (.p7s)" },
    { .name = "dds.security.permissions", .kind = TRANSPORT_SETTING_FILE,
      .text = "what this unit may publish and receive, signed (.p7s)" },
};

/// Null behind the last one.
static const char* interface_at(const transport_options* options, uint32_t index)
{
    return setting_text(options, "dds.interfaces", index);
}

const char* dds_config_environment(const transport_options* options)
{
    const char* environment = getenv("CYCLONEDDS_URI");
    const bool  given = environment != NULL && environment[0] != '\0';
    return given && interface_at(options, 0) == NULL ? environment : NULL;
}

bool dds_config_write(const transport_options* options, uint32_t domain, char* bytes, size_t size,
                      char* error, size_t error_size)
{
    if (!interfaces_check(options, domain, error, error_size)) {
        return false;
    }
    text        self = { .bytes = bytes, .room = size, .whole = true };
    const char* environment = dds_config_environment(options);
    const bool  theirs = environment != NULL;
    if (theirs) {
        put(&self, "%s,", environment);
    }
    put(&self, "<CycloneDDS><Domain id=\"any\">");
    if (!theirs) {
        put_interfaces(&self, options);
    }
    put_discovery(&self, options, domain, theirs);
    // Closing waits this long for readers that do not acknowledge, so that a daemon ends within 1
    // s.
    // The largest message, a plan, is one fragment: 1,364 bytes and 4 of its header.
    put(&self, "<Internal><WriterLingerDuration>200ms</WriterLingerDuration>"
               "<FragmentSize>1400B</FragmentSize></Internal>");
    if (setting_count(options, "dds.security.key") > 0 && !theirs) {
        // dds.c finds participants without a certificate in these lines.
        put(&self, "<Tracing><Category>discovery</Category><OutputFile>stderr</OutputFile>"
                   "</Tracing>");
    }
    put(&self, "</Domain></CycloneDDS>");
    if (!self.whole) {
        snprintf(error, error_size, "dds:%u: names and paths are too long together",
                 (unsigned)domain);
    }
    return self.whole;
}

static void put(text* self, const char* format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const size_t left = self->room - self->used;
    const int    length = vsnprintf(self->bytes + self->used, left, format, arguments);
    va_end(arguments);
    if (length < 0 || (size_t)length >= left) {
        self->whole = false;
        return;
    }
    self->used += (size_t)length;
}

static void put_escaped(text* self, const char* value)
{
    for (; *value != '\0'; ++value) {
        switch (*value) {
        case '<': put(self, "&lt;"); break;
        case '>': put(self, "&gt;"); break;
        case '&': put(self, "&amp;"); break;
        case '"': put(self, "&quot;"); break;
        default: put(self, "%c", *value); break;
        }
    }
}

static bool is_address(const char* interface)
{
    struct in_addr address;
    return inet_pton(AF_INET, interface, &address) == 1;
}

/// Data by unicast: a plan is for one vehicle, and radio links lose multicasts.
static void put_interfaces(text* self, const transport_options* options)
{
    put(self, "<General><Interfaces>");
    const char* interface;
    for (uint32_t i = 0; (interface = interface_at(options, i)) != NULL; ++i) {
        put(self, "<NetworkInterface %s=\"", is_address(interface) ? "address" : "name");
        put_escaped(self, interface);
        put(self, "\"/>");
    }
    if (interface_at(options, 0) == NULL) {
        put(self, "<NetworkInterface name=\"lo\"/>");
    }
    put(self, "</Interfaces><AllowMulticast>spdp</AllowMulticast></General>");
}

static bool is_loopback(const char* interface)
{
    return strcmp(interface, "lo") == 0 || strncmp(interface, "127.", 4) == 0;
}

/// True: the loopback interface is in use.
static bool on_loopback(const transport_options* options)
{
    const char* interface;
    for (uint32_t i = 0; (interface = interface_at(options, i)) != NULL; ++i) {
        if (is_loopback(interface)) {
            return true;
        }
    }
    return interface_at(options, 0) == NULL;
}

/// ExternalDomainId: in this process a domain has a number of its own, see dds.c.
static void put_discovery(text* self, const transport_options* options, uint32_t domain,
                          bool theirs)
{
    put(self, "<Discovery><ExternalDomainId>%u</ExternalDomainId>", (unsigned)domain);
    if (!theirs) {
        put(self, "<ParticipantIndex>auto</ParticipantIndex>"
                  "<MaxAutoParticipantIndex>31</MaxAutoParticipantIndex>"
                  "<SPDPInterval>1s</SPDPInterval>");
    }
    const uint32_t peers = setting_count(options, "dds.peers");
    if (!theirs || peers > 0) {
        put(self, "<Peers>");
    }
    if (!theirs && on_loopback(options)) {
        put(self, "<Peer address=\"127.0.0.1\"/>");
    }
    for (uint32_t i = 0; i < peers; ++i) {
        put(self, "<Peer address=\"");
        put_escaped(self, setting_text(options, "dds.peers", i));
        put(self, "\"/>");
    }
    if (!theirs || peers > 0) {
        put(self, "</Peers>");
    }
    put(self, "</Discovery>");
}

bool dds_config_leaves(const transport_options* options, char* interface, size_t size)
{
    const char* one;
    for (uint32_t i = 0; (one = interface_at(options, i)) != NULL; ++i) {
        if (!is_loopback(one)) {
            snprintf(interface, size, "interface %s", one);
            return true;
        }
    }
    if (dds_config_environment(options) != NULL) {
        snprintf(interface, size, "whatever interface CYCLONEDDS_URI names");
    }
    return dds_config_environment(options) != NULL;
}

static bool interfaces_check(const transport_options* options, uint32_t domain, char* error,
                             size_t error_size)
{
    const char* interface;
    for (uint32_t i = 0; (interface = interface_at(options, i)) != NULL; ++i) {
        char name[IF_NAMESIZE], names[256];
        if (!interface_known(interface, name, names, sizeof names)) {
            snprintf(error, error_size,
                     "dds:%u: this machine has no interface \"%.64s\" (dds.interfaces), expected "
                     "one of:%s", (unsigned)domain, interface, names);
            return false;
        }
    }
    char           names[DDS_INTERFACES_MAX][IF_NAMESIZE];
    const uint32_t count = dds_config_interfaces(options, names);
    for (uint32_t i = 0; i < count; ++i) {
        if (!dds_config_interface_up(names[i])) {
            snprintf(error, error_size, "dds:%u: the interface %s is down; run: ip link set %s up",
                     (unsigned)domain, names[i], names[i]);
            return false;
        }
    }
    return true;
}

/// By name or IPv4 address. name gets its name, names all there are.
static bool interface_known(const char* interface, char name[IF_NAMESIZE], char* names,
                            size_t names_size)
{
    struct ifaddrs* all = NULL;
    bool            known = false;
    text            list = { .bytes = names, .room = names_size, .whole = true };
    names[0] = '\0';
    snprintf(name, IF_NAMESIZE, "%.*s", IF_NAMESIZE - 1, interface);
    if (getifaddrs(&all) != 0) {
        return true; // Cyclone reports the fault
    }
    for (const struct ifaddrs* one = all; one != NULL; one = one->ifa_next) {
        const bool named = strcmp(interface, one->ifa_name) == 0;
        known = known || named; // one that is down has no address
        if (one->ifa_addr == NULL || one->ifa_addr->sa_family != AF_INET) {
            continue;
        }
        char                      address[INET_ADDRSTRLEN] = "";
        const struct sockaddr_in* in = (const struct sockaddr_in*)(const void*)one->ifa_addr;
        (void)inet_ntop(AF_INET, &in->sin_addr, address, sizeof address);
        if (strcmp(interface, address) == 0) {
            known = true;
            snprintf(name, IF_NAMESIZE, "%.*s", IF_NAMESIZE - 1, one->ifa_name);
        }
        put(&list, " %s (%s)", one->ifa_name, address);
    }
    freeifaddrs(all);
    return known;
}

uint32_t dds_config_interfaces(const transport_options* options,
                               char names[DDS_INTERFACES_MAX][IF_NAMESIZE])
{
    if (dds_config_environment(options) != NULL) {
        return 0;
    }
    uint32_t    count = 0;
    const char* interface;
    while (count < DDS_INTERFACES_MAX && (interface = interface_at(options, count)) != NULL) {
        char all[256];
        (void)interface_known(interface, names[count++], all, sizeof all);
    }
    if (count == 0) {
        strcpy(names[count++], "lo");
    }
    return count;
}

bool dds_config_interface_up(const char* name)
{
    struct ifreq request = { 0 };
    const int    probe = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    snprintf(request.ifr_name, sizeof request.ifr_name, "%.*s", IF_NAMESIZE - 1, name);
    const bool asked = probe >= 0 && ioctl(probe, SIOCGIFFLAGS, &request) == 0;
    if (probe >= 0) {
        close(probe);
    }
    const int works = IFF_UP | IFF_RUNNING;
    return asked && (request.ifr_flags & works) == works;
}
