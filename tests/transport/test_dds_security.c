/// Goal: unusable files are refused before the middleware reads them, with the field, the path,
///       the reason and the remedy; certificates of tools/certs are accepted.
/// Method: two sets of certificates with the same names by tools/certs, and one thing wrong at a
///         time, made with OpenSSL's program.
#include "check.h"
#include "dds_security.h"
#include "hmac.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

static char folder[] = "/tmp/verge_test_pki_XXXXXX";

static int shell(const char* format, ...) __attribute__((format(printf, 1, 2)));

static int shell(const char* format, ...)
{
    char    command[1024], whole[1200];
    va_list args;
    va_start(args, format);
    vsnprintf(command, sizeof command, format, args);
    va_end(args);
    snprintf(whole, sizeof whole, "cd %s && (%s) >>log 2>&1", folder, command);
    return system(whole);
}

static int make_certificates(void** state)
{
    (void)state;
    if (system("command -v openssl >/dev/null") != 0) {
        printf("SKIPPED: the program openssl is missing (tools/setup installs it)\n");
        exit(77);
    }
    assert_non_null(mkdtemp(folder));
    return shell(VERGE_SOURCE_DIR "/tools/certs --out %s/ours", folder) |
           shell(VERGE_SOURCE_DIR "/tools/certs --out %s/foreign", folder);
}

static int remove_certificates(void** state)
{
    (void)state;
    char command[128];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command);
}

/// Paths of our rsu's files; a case changes one.
typedef struct paths {
    char identity_ca[80], certificate[80], key[80], permissions_ca[80], governance[80],
        permissions[80];
} paths;

static void path_set(char path[80], const char* name)
{
    snprintf(path, 80, "%s/%s", folder, name);
}

static paths paths_of(const char* set, const char* who)
{
    paths p;
    snprintf(p.identity_ca, 80, "%s/%s/identity_ca.crt.pem", folder, set);
    snprintf(p.certificate, 80, "%s/%s/%s.crt.pem", folder, set, who);
    snprintf(p.key, 80, "%s/%s/%s.key.pem", folder, set, who);
    snprintf(p.permissions_ca, 80, "%s/%s/permissions_ca.crt.pem", folder, set);
    snprintf(p.governance, 80, "%s/%s/governance.p7s", folder, set);
    snprintf(p.permissions, 80, "%s/%s/%s.permissions.p7s", folder, set, who);
    return p;
}

static dds_security_files files_of(const paths* p)
{
    return (dds_security_files){
        .identity_ca = p->identity_ca, .certificate = p->certificate, .key = p->key,
        .permissions_ca = p->permissions_ca, .governance = p->governance,
        .permissions = p->permissions,
    };
}

static bool check(const paths* p, char error[512])
{
    const dds_security_files files = files_of(p);
    error[0] = '\0';
    return dds_security_check(&files, error, 512);
}

static void check_refused(const paths* p, const char* field, const char* path, const char* reason)
{
    char error[512], begin[160];
    snprintf(begin, sizeof begin, "dds.security.%s: %s: ", field, path);
    if (check(p, error)) {
        fail_msg("%s %s was taken; expected: %s", field, path, reason);
    }
    if (strncmp(error, begin, strlen(begin)) != 0 || strstr(error, reason) == NULL) {
        fail_msg("told as: %s\nexpected: %s... %s", error, begin, reason);
    }
    assert_null(strchr(error, '\n'));
}

static void test_certificates_of_tools_certs_are_accepted(void** state)
{
    (void)state;
    static const char* const who[] = { "rsu", "vehicle" };
    for (int i = 0; i < 2; ++i) {
        char        error[512];
        const paths p = paths_of("ours", who[i]);
        if (!check(&p, error)) {
            fail_msg("%s", error);
        }
    }
}

static void test_each_missing_file_is_named(void** state)
{
    (void)state;
    static const struct { const char* field; size_t offset; } fields[] = {
        { "identity_ca", offsetof(paths, identity_ca) },
        { "certificate", offsetof(paths, certificate) },
        { "key", offsetof(paths, key) },
        { "permissions_ca", offsetof(paths, permissions_ca) },
        { "governance", offsetof(paths, governance) },
        { "permissions", offsetof(paths, permissions) },
    };
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; ++i) {
        paths p = paths_of("ours", "rsu");
        char* path = (char*)&p + fields[i].offset;
        path_set(path, "absent");
        check_refused(&p, fields[i].field, path, "cannot be read");
        if (hmac_available()) { // what is in a file needs OpenSSL to tell
            assert_int_equal(shell("echo nonsense > garbage; chmod 600 garbage"), 0);
            path_set(path, "garbage");
            check_refused(&p, fields[i].field, path, "expected");
        }
    }
}

static void test_a_key_that_others_can_read_is_refused(void** state)
{
    (void)state;
    static const char* const modes[] = { "644", "640", "604", "660" };
    paths p = paths_of("ours", "rsu");
    path_set(p.key, "open.key");
    for (size_t i = 0; i < 4; ++i) {
        assert_int_equal(shell("cp ours/rsu.key.pem open.key; chmod %s open.key", modes[i]), 0);
        check_refused(&p, "key", p.key, "chmod 600");
    }
    char error[512];
    assert_int_equal(shell("chmod 400 open.key"), 0);
    assert_true(check(&p, error));
}

static void need_openssl(void)
{
    if (!hmac_available()) {
        printf("             SKIPPED: built without OpenSSL (VERGE_OPENSSL=OFF)\n");
        skip();
    }
}

static void test_certificates_that_do_not_match_are_refused(void** state)
{
    (void)state;
    need_openssl();
    const paths foreign = paths_of("foreign", "rsu");
    const paths vehicle = paths_of("ours", "vehicle");

    paths p = paths_of("ours", "rsu");
    strcpy(p.key, vehicle.key);
    check_refused(&p, "certificate", p.certificate, "does not belong to the private key");
    p = paths_of("ours", "rsu"); // another authority with the same names
    strcpy(p.identity_ca, foreign.identity_ca);
    check_refused(&p, "certificate", p.certificate, "is not signed by the authority");
    p = paths_of("ours", "rsu");
    strcpy(p.governance, foreign.governance);
    check_refused(&p, "governance", p.governance, "is not signed by dds.security.permissions_ca");
    p = paths_of("ours", "rsu");
    strcpy(p.permissions, foreign.permissions);
    check_refused(&p, "permissions", p.permissions, "is not signed by dds.security.permissions_ca");
    p = paths_of("ours", "rsu");
    strcpy(p.permissions, vehicle.permissions);
    check_refused(&p, "permissions", p.permissions, "\"CN=rsu,O=verge\"");

    p = paths_of("ours", "rsu");
    path_set(p.governance, "tampered.p7s");
    assert_int_equal(shell("sed s,ENCRYPT,NONE,g ours/governance.p7s > tampered.p7s"), 0);
    check_refused(&p, "governance", p.governance, "was changed since");
    p = paths_of("ours", "rsu");
    path_set(p.key, "locked.key");
    assert_int_equal(shell("openssl ec -aes128 -passout pass:secret -in ours/rsu.key.pem "
                           "-out locked.key; chmod 600 locked.key"), 0);
    check_refused(&p, "key", p.key, "without a passphrase");
}

static void test_an_expired_certificate_is_refused_with_its_date(void** state)
{
    (void)state;
    need_openssl();
    paths p = paths_of("ours", "rsu");
    path_set(p.certificate, "old.crt");
    assert_int_equal(shell("openssl req -new -key ours/rsu.key.pem -subj /O=verge/CN=rsu "
                           "-out old.csr && openssl x509 -req -days -1 -in old.csr "
                           "-CA ours/identity_ca.crt.pem -CAkey ours/identity_ca.key.pem "
                           "-CAcreateserial -out old.crt"), 0);
    check_refused(&p, "certificate", p.certificate, "has expired on ");

    static const char* const spans[][2] = { { "2001-01-01T00:00:00Z", "2002-01-01T00:00:00Z" },
                                            { "2901-01-01T00:00:00", "2902-01-01T00:00:00" } };
    for (int i = 0; i < 2; ++i) {
        p = paths_of("ours", "rsu");
        path_set(p.permissions, "old.p7s");
        assert_int_equal(
            shell("sed -E 's,(<not_before>)[^<]*,\\1%s,; s,(<not_after>)[^<]*,\\1%s,' "
                  "ours/rsu.permissions.xml > old.xml && openssl smime -sign -text -in old.xml "
                  "-out old.p7s -signer ours/permissions_ca.crt.pem "
                  "-inkey ours/permissions_ca.key.pem", spans[i][0], spans[i][1]), 0);
        check_refused(&p, "permissions", p.permissions, spans[i][1]);
    }
}

/// Days from now, rounded.
static long check_first_end(const char* set, const char* who, const char* field)
{
    const paths                  p = paths_of(set, who);
    const dds_security_files files = files_of(&p);
    char                         words[512], begin[64];
    int64_t                      utime = 0;
    snprintf(begin, sizeof begin, "dds.security.%s: %s/", field, folder);
    if (!dds_security_expires(&files, &utime, words, sizeof words)) {
        fail_msg("%s", words);
    }
    if (strncmp(words, begin, strlen(begin)) != 0 || strstr(words, "renew") == NULL) {
        fail_msg("told as: %s\nexpected: %s", words, begin);
    }
    return (long)((utime / 1000000 - time(NULL) + 43200) / 86400);
}

static void test_the_earliest_expiry_date_of_the_certificates_is_reported(void** state)
{
    (void)state;
    need_openssl();
    static const char certs[] = VERGE_SOURCE_DIR "/tools/certs";
    assert_int_equal(shell("%s --out %s/ends --days 50 rsu", certs, folder), 0);
    assert_int_equal(check_first_end("ends", "rsu", "certificate"), 50);
    // The certificate is good for a month more and stays, the permissions are written anew.
    assert_int_equal(shell("%s --out %s/ends --days 40 rsu", certs, folder), 0);
    assert_int_equal(check_first_end("ends", "rsu", "permissions"), 40);
    // The authority is made for ten years.
    assert_int_equal(shell("%s --out %s/ends --days 9999 vehicle", certs, folder), 0);
    assert_int_equal(check_first_end("ends", "vehicle", "identity_ca"), 3650);
    paths p = paths_of("ends", "rsu");
    const dds_security_files files = files_of(&p);
    char    words[512];
    int64_t utime = 0;
    path_set(p.certificate, "absent");
    assert_false(dds_security_expires(&files, &utime, words, sizeof words));
}

static void test_rules_that_admit_unknown_participants_are_reported(void** state)
{
    (void)state;
    need_openssl();
    static const struct { const char *element, *value; } lax[] = {
        { "allow_unauthenticated_participants", "true" },
        { "allow_unauthenticated_participants", "1" },
        { "enable_join_access_control", "false" },
        { "enable_write_access_control", " False " },
    };
    char                         words[512];
    paths                        p = paths_of("ours", "rsu");
    const dds_security_files files = files_of(&p);
    assert_false(dds_security_lax(&files, words, sizeof words));
    path_set(p.governance, "lax.p7s");
    for (size_t i = 0; i < sizeof lax / sizeof lax[0]; ++i) {
        char error[512];
        assert_int_equal(
            shell("sed -E 's,(<%s>)[^<]*,\\1%s,' ours/governance.xml > lax.xml && openssl smime "
                  "-sign -text -in lax.xml -out lax.p7s -signer ours/permissions_ca.crt.pem "
                  "-inkey ours/permissions_ca.key.pem", lax[i].element, lax[i].value), 0);
        assert_true(check(&p, error)); // well signed
        assert_true(dds_security_lax(&files, words, sizeof words));
        assert_non_null(strstr(words, lax[i].element));
        assert_non_null(strstr(words, p.governance));
    }
    const transport_setting settings[] = {
        { "dds.interfaces", "verge9" }, // no such interface: not loopback
        { "dds.security.identity_ca", files.identity_ca },
        { "dds.security.certificate", files.certificate },
        { "dds.security.key", files.key },
        { "dds.security.permissions_ca", files.permissions_ca },
        { "dds.security.governance", files.governance },
        { "dds.security.permissions", files.permissions },
    };
    const transport_options options = { .settings = settings, .setting_count = 7 };
    if (transport_url_fault("dds:0") == NULL) { // built in
        assert_true(transport_exposed("dds:0", &options, words, sizeof words));
        assert_non_null(strstr(words, "enable_write_access_control"));
    }
    assert_int_equal(shell("echo > lax.p7s"), 0);
    assert_false(dds_security_lax(&files, words, sizeof words));
}

static void test_running_tools_certs_again_keeps_what_is_good_and_adds(void** state)
{
    (void)state;
    assert_int_equal(shell("cp -r ours before && " VERGE_SOURCE_DIR
                           "/tools/certs --out %s/ours rsu vehicle car_9 watch:observer", folder), 0);
    assert_int_equal(shell("cmp ours/rsu.key.pem before/rsu.key.pem && "
                           "cmp ours/rsu.crt.pem before/rsu.crt.pem && "
                           "cmp ours/lcm.key before/lcm.key && "
                           "cmp ours/identity_ca.crt.pem before/identity_ca.crt.pem"), 0);
    char        error[512];
    const paths car = paths_of("ours", "car_9");
    if (!check(&car, error)) {
        fail_msg("%s", error);
    }
    assert_int_equal(shell("grep -q '<publish>.*VERGE_STATE' ours/car_9.permissions.xml && "
                           "! grep -q '<publish>' ours/watch.permissions.xml"), 0);
    assert_int_equal(shell("test -z \"$(find ours -type f -perm /077)\""), 0);
    // An authority whose key was put away must not be replaced in silence.
    assert_int_equal(shell("mv ours/identity_ca.key.pem away"), 0);
    assert_int_not_equal(shell(VERGE_SOURCE_DIR "/tools/certs --out %s/ours", folder), 0);
    assert_int_equal(shell("mv away ours/identity_ca.key.pem; tail -1 log | grep -q 'restore it'"),
                     0);
    static const char* const wrong[] = { "a.b", "a:driver", "--days 0", "--days x", "--bogus",
                                         "--out /proc/nowhere", "identity_ca", "--out" };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
        assert_int_not_equal(shell(VERGE_SOURCE_DIR "/tools/certs %s", wrong[i]), 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_certificates_of_tools_certs_are_accepted),
        cmocka_unit_test(test_each_missing_file_is_named),
        cmocka_unit_test(test_a_key_that_others_can_read_is_refused),
        cmocka_unit_test(test_certificates_that_do_not_match_are_refused),
        cmocka_unit_test(test_an_expired_certificate_is_refused_with_its_date),
        cmocka_unit_test(test_the_earliest_expiry_date_of_the_certificates_is_reported),
        cmocka_unit_test(test_rules_that_admit_unknown_participants_are_reported),
        cmocka_unit_test(test_running_tools_certs_again_keeps_what_is_good_and_adds),
    };
    return cmocka_run_group_tests(tests, make_certificates, remove_certificates);
}
