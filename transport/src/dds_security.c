#include "dds_security.h"

#include "secret.h"
#include "settings.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/// Where a fault is reported; the line begins with the field and its path.
typedef struct report {
    char*       error;
    size_t      size;
    const char* field;
    const char* path;
} report;

const dds_security_files* dds_security_asked(const transport_options* options,
                                             dds_security_files* files)
{
    *files = (dds_security_files){
        .identity_ca = setting_text(options, "dds.security.identity_ca", 0),
        .certificate = setting_text(options, "dds.security.certificate", 0),
        .key = setting_text(options, "dds.security.key", 0),
        .permissions_ca = setting_text(options, "dds.security.permissions_ca", 0),
        .governance = setting_text(options, "dds.security.governance", 0),
        .permissions = setting_text(options, "dds.security.permissions", 0),
    };
    return files->key != NULL ? files : NULL;
}

static bool fail(const report* to, const char* format, ...)
    __attribute__((format(printf, 2, 3)));

static bool fail(const report* to, const char* format, ...)
{
    const int named =
        snprintf(to->error, to->size, "dds.security.%s: %s: ", to->field, to->path);
    if (named > 0 && (size_t)named < to->size) {
        va_list args;
        va_start(args, format);
        vsnprintf(to->error + named, to->size - (size_t)named, format, args);
        va_end(args);
    }
    return false;
}

/// The private key's descriptor, or -1.
static int key_open(const report* to)
{
    const int named = snprintf(to->error, to->size, "dds.security.%s: ", to->field);
    return secret_open(to->path, to->error + named, to->size - (size_t)named);
}

#ifdef VERGE_OPENSSL
#include <ctype.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>
#include <strings.h>
#include <time.h>

/// The objects that were read, to be freed together.
typedef struct papers {
    X509 *    identity_ca, *certificate, *permissions_ca;
    EVP_PKEY* key;
    BIO *     governance, *permissions; ///< the documents' text, once verified
    time_t    granted_until;
} papers;

static bool papers_check(papers* self, const dds_security_files* files, char* error,
                         size_t error_size);
static void papers_free(papers* self);
static bool certificate_read(X509** certificate, const report* to);
static bool key_read(EVP_PKEY** key, const report* to);
static bool document_read(BIO** text, X509* authority, const report* to);
static bool grant_check(papers* self, const report* to);

bool dds_security_check(const dds_security_files* files, char* error, size_t error_size)
{
    papers     self = { .key = NULL };
    const bool good = papers_check(&self, files, error, error_size);
    papers_free(&self);
    return good;
}

static void papers_free(papers* self)
{
    X509_free(self->identity_ca);
    X509_free(self->certificate);
    X509_free(self->permissions_ca);
    EVP_PKEY_free(self->key);
    BIO_free(self->governance);
    BIO_free(self->permissions);
    ERR_clear_error();
}

static bool papers_check(papers* self, const dds_security_files* files, char* error,
                         size_t error_size)
{
    const report identity_ca = { error, error_size, "identity_ca", files->identity_ca };
    const report certificate = { error, error_size, "certificate", files->certificate };
    const report key = { error, error_size, "key", files->key };
    const report permissions_ca = { error, error_size, "permissions_ca", files->permissions_ca };
    const report governance = { error, error_size, "governance", files->governance };
    const report permissions = { error, error_size, "permissions", files->permissions };

    if (!key_read(&self->key, &key) || !certificate_read(&self->identity_ca, &identity_ca) ||
        !certificate_read(&self->certificate, &certificate)) {
        return false;
    }
    if (X509_check_private_key(self->certificate, self->key) != 1) {
        return fail(&certificate, "does not belong to the private key %s, expected the "
                                  "certificate made for it", files->key);
    }
    if (X509_check_issued(self->identity_ca, self->certificate) != X509_V_OK ||
        X509_verify(self->certificate, X509_get0_pubkey(self->identity_ca)) != 1) {
        return fail(&certificate, "is not signed by the authority %s, expected a certificate "
                                  "of its own", files->identity_ca);
    }
    return certificate_read(&self->permissions_ca, &permissions_ca) &&
           document_read(&self->governance, self->permissions_ca, &governance) &&
           document_read(&self->permissions, self->permissions_ca, &permissions) &&
           grant_check(self, &permissions);
}

// ---- certificates and keys ----------------------------------------------------------------

static BIO* file_open(const report* to)
{
    const char* reason = NULL;
    const int   fd = regular_open(to->path, &reason);
    FILE*       stream = fd >= 0 ? fdopen(fd, "r") : NULL;
    BIO*        file = stream != NULL ? BIO_new_fp(stream, BIO_CLOSE) : NULL;
    if (fd < 0) {
        fail(to, "cannot be read (%s), expected a file this user may read", reason);
    } else if (file == NULL) {
        fail(to, "cannot be read, the system refused memory");
        if (stream != NULL) {
            fclose(stream);
        } else {
            close(fd);
        }
    }
    return file;
}

/// "Nov 21 15:17:40 2026 GMT"
static void time_write(const ASN1_TIME* at, char text[64])
{
    BIO* out = BIO_new(BIO_s_mem());
    int  size = 0;
    if (out != NULL && ASN1_TIME_print(out, at) == 1) {
        size = BIO_read(out, text, 63);
    }
    text[size > 0 ? size : 0] = '\0';
    BIO_free(out);
}

static bool certificate_read(X509** certificate, const report* to)
{
    BIO* file = file_open(to);
    if (file == NULL) {
        return false;
    }
    *certificate = PEM_read_bio_X509(file, NULL, NULL, NULL);
    BIO_free(file);
    if (*certificate == NULL) {
        return fail(to, "is no certificate, expected one in PEM (-----BEGIN CERTIFICATE-----)");
    }
    char when[64];
    if (X509_cmp_current_time(X509_get0_notBefore(*certificate)) > 0) {
        time_write(X509_get0_notBefore(*certificate), when);
        return fail(to, "is not valid before %s, expected a valid one: set this machine's clock "
                        "or renew it", when);
    }
    if (X509_cmp_current_time(X509_get0_notAfter(*certificate)) < 0) {
        time_write(X509_get0_notAfter(*certificate), when);
        return fail(to, "has expired on %s, expected a valid one: renew it", when);
    }
    return true;
}

static bool key_read(EVP_PKEY** key, const report* to)
{
    static char no_passphrase[] = ""; // null would ask for one on the terminal
    const int   fd = key_open(to);
    if (fd < 0) {
        return false;
    }
    BIO* file = BIO_new_fd(fd, BIO_CLOSE);
    if (file == NULL) {
        close(fd);
        return fail(to, "out of memory");
    }
    *key = PEM_read_bio_PrivateKey(file, NULL, NULL, no_passphrase);
    BIO_free(file);
    return *key != NULL || fail(to, "is no private key, expected one in PEM without a passphrase");
}

// ---- signed documents ---------------------------------------------------------------------

/// text: the document without its signature.
static bool document_read(BIO** text, X509* authority, const report* to)
{
    BIO* file = file_open(to);
    if (file == NULL) {
        return false;
    }
    BIO*        content = NULL;
    PKCS7*      signature = SMIME_read_PKCS7(file, &content);
    X509_STORE* trusted = X509_STORE_new();
    bool        good = false;
    *text = BIO_new(BIO_s_mem());
    if (signature == NULL || content == NULL) {
        fail(to, "is no signed document, expected S/MIME as `openssl smime -sign` makes it");
    } else if (*text == NULL || trusted == NULL || X509_STORE_add_cert(trusted, authority) != 1) {
        fail(to, "out of memory");
    } else if (PKCS7_verify(signature, NULL, trusted, content, *text, 0) != 1) {
        const char* cause = ERR_reason_error_string(ERR_peek_last_error());
        fail(to, "is not signed by dds.security.permissions_ca or was changed since (%s), expected "
                 "a document of that authority", cause != NULL ? cause : "no reason given");
    } else {
        good = true;
    }
    X509_STORE_free(trusted);
    PKCS7_free(signature);
    BIO_free(content);
    BIO_free(file);
    return good;
}

/// The text between <element> and its end, at or after *at; *at moves behind it.
static bool element_find(const char** at, const char* element, char* value, size_t size)
{
    char open[48], end[48];
    snprintf(open, sizeof open, "<%s>", element);
    snprintf(end, sizeof end, "</%s>", element);
    const char* from = strstr(*at, open);
    const char* to = from != NULL ? strstr(from, end) : NULL;
    if (to == NULL) {
        return false;
    }
    from += strlen(open);
    const size_t length = (size_t)(to - from) < size ? (size_t)(to - from) : size - 1;
    memcpy(value, from, length);
    value[length] = '\0';
    *at = to + strlen(end);
    return true;
}

/// "O = verge, CN = rsu" in the order and spacing it happens to have: its parts, each without
/// blanks around itself and its '='. Returns how many, at most max.
static size_t subject_split(char* text, char** parts, size_t max)
{
    size_t count = 0;
    char*  rest = NULL;
    for (char* part = strtok_r(text, ",", &rest); part != NULL && count < max;
         part = strtok_r(NULL, ",", &rest)) {
        char* to = part;
        bool  name = true; // left of the '='
        part += strspn(part, " \t\r\n");
        parts[count++] = to;
        for (; *part != '\0'; ++part) {
            const bool blank = isspace((unsigned char)*part) != 0;
            if (!(blank && (name || to[-1] == '='))) {
                *to++ = *part;
            }
            name = name && *part != '=';
        }
        while (to > parts[count - 1] && isspace((unsigned char)to[-1])) {
            --to;
        }
        *to = '\0';
    }
    return count;
}

static bool subjects_equal(const char* one, const char* other)
{
    enum { SIZE = 512, PARTS = 16 };
    char  mine[SIZE], theirs[SIZE];
    char *my_parts[PARTS], *their_parts[PARTS];
    snprintf(mine, sizeof mine, "%s", one);
    snprintf(theirs, sizeof theirs, "%s", other);
    const size_t count = subject_split(mine, my_parts, PARTS);
    size_t       same = 0;
    if (subject_split(theirs, their_parts, PARTS) != count) {
        return false;
    }
    for (size_t i = 0; i < count; ++i) {
        for (size_t j = 0; j < count; ++j) {
            if (strcmp(my_parts[i], their_parts[j]) == 0) {
                ++same;
                break;
            }
        }
    }
    return same == count;
}

/// Seconds since 1970 of "2026-11-21T15:17:40Z", with or without the Z. False: no such instant.
static bool instant_parse(const char* text, time_t* instant)
{
    struct tm   parts = { .tm_isdst = 0 };
    const char* end = strptime(text, "%Y-%m-%dT%H:%M:%S", &parts);
    *instant = end != NULL ? timegm(&parts) : 0;
    return end != NULL;
}

/// Permissions granted to other participants are not checked.
static bool grant_check(papers* self, const report* to)
{
    char  subject[512] = "", granted[512] = "", before[40], after[40];
    char* bytes = NULL;
    (void)BIO_write(self->permissions, "", 1); // a terminator
    (void)BIO_get_mem_data(self->permissions, &bytes);
    BIO* name = BIO_new(BIO_s_mem());
    if (name != NULL) {
        X509_NAME_print_ex(name, X509_get_subject_name(self->certificate), 0, XN_FLAG_RFC2253);
        const int size = BIO_read(name, subject, sizeof subject - 1);
        subject[size > 0 ? size : 0] = '\0';
        BIO_free(name);
    }
    const char* at = bytes;
    bool        found = false;
    while (!found && element_find(&at, "subject_name", granted, sizeof granted)) {
        found = subjects_equal(subject, granted);
    }
    if (!found) {
        return fail(to, "grants \"%.100s\" something but \"%.100s\", the certificate's subject, "
                        "nothing: expected the permissions made for it", granted, subject);
    }
    time_t from;
    if (!element_find(&at, "not_before", before, sizeof before) ||
        !element_find(&at, "not_after", after, sizeof after) || !instant_parse(before, &from) ||
        !instant_parse(after, &self->granted_until)) {
        return fail(to, "has no readable validity for \"%s\", expected not_before and not_after",
                    subject);
    }
    const time_t now = time(NULL);
    if (now < from || now > self->granted_until) {
        return fail(to, "grants from %s to %s, expected today among it: renew it", before, after);
    }
    return true;
}

// ---- expiry -------------------------------------------------------------------------------

static time_t certificate_end(const X509* certificate)
{
    struct tm parts;
    return ASN1_TIME_to_tm(X509_get0_notAfter(certificate), &parts) == 1 ? timegm(&parts) : 0;
}

bool dds_security_expires(const dds_security_files* files, int64_t* utime, char* words,
                          size_t words_size)
{
    papers     self = { .key = NULL };
    const bool good = papers_check(&self, files, words, words_size);
    if (good) {
        const struct { const char *field, *path; time_t end; } papers[] = {
            { "certificate", files->certificate, certificate_end(self.certificate) },
            { "permissions", files->permissions, self.granted_until },
            { "identity_ca", files->identity_ca, certificate_end(self.identity_ca) },
            { "permissions_ca", files->permissions_ca, certificate_end(self.permissions_ca) },
        };
        size_t first = 0;
        for (size_t i = 1; i < sizeof papers / sizeof papers[0]; ++i) {
            first = papers[i].end < papers[first].end ? i : first;
        }
        char      date[32] = "";
        struct tm parts;
        if (gmtime_r(&papers[first].end, &parts) != NULL) {
            strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%SZ", &parts);
        }
        *utime = (int64_t)papers[first].end * 1000000;
        snprintf(words, words_size, "dds.security.%s: %s: ends on %s: renew it and reload",
                 papers[first].field, papers[first].path, date);
    }
    papers_free(&self);
    return good;
}

// ---- rules --------------------------------------------------------------------------------

/// The first rule that admits participants without a certificate or permission; null: none.
static const char* rule_lax(const char* governance)
{
    static const struct { const char *element, *value, *digit, *words; } lax[] = {
        { "allow_unauthenticated_participants", "true", "1",
          "allow_unauthenticated_participants is true: participants without a certificate are "
          "admitted" },
        { "enable_join_access_control", "false", "0",
          "enable_join_access_control is false: participants without permissions are admitted" },
        { "enable_write_access_control", "false", "0",
          "enable_write_access_control is false: permissions do not limit publishing" },
    };
    for (size_t i = 0; i < sizeof lax / sizeof lax[0]; ++i) {
        char        value[16], word[16] = "";
        const char* at = governance;
        while (element_find(&at, lax[i].element, value, sizeof value)) {
            (void)sscanf(value, "%15s", word);
            if (strcasecmp(word, lax[i].value) == 0 || strcmp(word, lax[i].digit) == 0) {
                return lax[i].words;
            }
        }
    }
    return NULL;
}

bool dds_security_lax(const dds_security_files* files, char* words, size_t words_size)
{
    papers      self = { .key = NULL };
    const char* lax = NULL;
    if (papers_check(&self, files, words, words_size)) {
        char* bytes = NULL;
        (void)BIO_write(self.governance, "", 1); // a terminator
        (void)BIO_get_mem_data(self.governance, &bytes);
        lax = rule_lax(bytes);
    }
    papers_free(&self);
    if (lax != NULL) {
        snprintf(words, words_size, "dds.security.governance: %s: %s", files->governance, lax);
    }
    return lax != NULL;
}

#else

bool dds_security_expires(const dds_security_files* files, int64_t* utime, char* words,
                          size_t words_size)
{
    (void)files;
    (void)utime;
    (void)words;
    (void)words_size;
    return false;
}

bool dds_security_lax(const dds_security_files* files, char* words, size_t words_size)
{
    (void)files;
    (void)words;
    (void)words_size;
    return false;
}

bool dds_security_check(const dds_security_files* files, char* error, size_t error_size)
{
    const report key = { error, error_size, "key", files->key };
    const int    fd = key_open(&key);
    if (fd < 0) {
        return false;
    }
    close(fd);
    const report others[] = {
        { error, error_size, "identity_ca", files->identity_ca },
        { error, error_size, "certificate", files->certificate },
        { error, error_size, "permissions_ca", files->permissions_ca },
        { error, error_size, "governance", files->governance },
        { error, error_size, "permissions", files->permissions },
    };
    for (size_t i = 0; i < sizeof others / sizeof others[0]; ++i) {
        const char* reason = NULL;
        const int   file = regular_open(others[i].path, &reason);
        if (file < 0) {
            return fail(&others[i], "cannot be read (%s), expected a file this user may read",
                        reason);
        }
        close(file);
    }
    return true;
}

#endif
